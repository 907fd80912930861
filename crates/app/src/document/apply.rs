//! From the file's version of a scene and the edits to the version that is shown.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Quat, Vec3};
use tracer::import::SceneNode;
use tracer::scene::{Environment, EnvironmentImage, PunctualKind, PunctualLight, Scene};

use super::edits::{Edits, EnvironmentEdit, LightEdit, Move};
use super::tree::Tree;

/// A scale below this leaves nothing to see and no inverse.
const SMALLEST_SCALE: f32 = 1e-4;

impl Move {
    /// The same with numbers that can be used: a unit rotation, no scale of 0, nothing infinite.
    #[must_use]
    pub fn sane(self) -> Self {
        let scale = |x: f32| match x {
            x if !x.is_finite() => 1.0,
            x if x.abs() < SMALLEST_SCALE => SMALLEST_SCALE.copysign(x),
            x => x,
        };
        Self {
            translation: if self.translation.is_finite() { self.translation } else { Vec3::ZERO },
            rotation: if self.rotation.is_finite() && self.rotation.length_squared() > 1e-12 {
                self.rotation.normalize()
            } else {
                Quat::IDENTITY
            },
            scale: Vec3::from_array(self.scale.to_array().map(scale)),
        }
    }

    /// What takes a point of the file's world to where the move puts it, for a node at this place.
    pub fn world_from_file(self, world_from_node: &Affine3A) -> Affine3A {
        let Self { translation, rotation, scale } = self.sane();
        let linear = world_from_node.matrix3;
        let inverse = linear.inverse();
        // A flattened node has no axes of its own to scale along.
        let scaled = if inverse.is_finite() { linear * Mat3A::from_diagonal(scale) * inverse } else { Mat3A::IDENTITY };
        let turned = Mat3A::from_quat(rotation) * scaled;
        let origin = world_from_node.translation;
        Affine3A { matrix3: turned, translation: origin + glam::Vec3A::from(translation) - turned * origin }
    }
}

/// What takes a point of the file's world to where the edits of a node and of all that it hangs on put it.
pub fn world_from_file(node: u32, nodes: &[SceneNode], tree: &Tree, edits: &Edits) -> Affine3A {
    tree.line(node).fold(Affine3A::IDENTITY, |moved, node| {
        let own = edits.nodes.get(&node).zip(nodes.get(node as usize));
        match own {
            Some((edit, node)) if edit.moved != Move::default() => {
                edit.moved.world_from_file(&node.world_from_node) * moved
            }
            _ => moved,
        }
    })
}

/// Whether a node is shown, where the file says whether what it places is.
pub fn is_visible(node: u32, in_file: bool, tree: &Tree, edits: &Edits, solo: Option<u32>) -> bool {
    if solo.is_some_and(|solo| !tree.line(node).any(|above| above == solo)) {
        return false;
    }
    let mut shown = in_file;
    for above in tree.line(node) {
        match edits.nodes.get(&above).and_then(|edit| edit.hidden) {
            Some(true) => return false,
            Some(false) => shown = true,
            None => {}
        }
    }
    shown
}

/// Whether a node that hangs on nothing hidden is shown without an edit of its own visibility.
pub fn is_usually_visible(node: u32, tree: &Tree, edits: &Edits) -> bool {
    let shows = |above: u32| edits.nodes.get(&above).is_some_and(|edit| edit.hidden == Some(false));
    tree.is_shown_in_file(node) || tree.line(node).skip(1).any(shows)
}

/// The version of the scene that the edits make of the file's; `image` is the environment that they name, once it is read.
pub fn apply(
    file: &Scene,
    nodes: &[SceneNode],
    tree: &Tree,
    edits: &Edits,
    solo: Option<u32>,
    image: Option<&Arc<EnvironmentImage>>,
) -> Scene {
    let mut scene = file.clone();
    if !edits.nodes.is_empty() || solo.is_some() {
        for instance in &mut scene.instances {
            instance.visible = is_visible(instance.node, instance.visible, tree, edits, solo);
            if tree.line(instance.node).any(|node| edits.nodes.contains_key(&node)) {
                let moved = world_from_file(instance.node, nodes, tree, edits) * instance.world_from_mesh;
                // A product of moves that leaves the numbers is not made.
                if moved.is_finite() && moved.matrix3.determinant() != 0.0 {
                    instance.world_from_mesh = moved;
                }
            }
        }
    }
    for (index, values) in &edits.materials {
        let Some(material) = scene.materials.get_mut(*index as usize) else { continue };
        let mut edited = (**material).clone();
        values.iter().for_each(|(parameter, value)| parameter.set(&mut edited, *value));
        *material = Arc::new(edited);
    }
    for (index, edit) in &edits.lights {
        if let Some(light) = scene.lights.get_mut(*index as usize) {
            apply_light(light, edit);
        }
    }
    apply_environment(&mut scene.environment, &edits.environment, image);
    scene.backdrop = edits.environment.backdrop.unwrap_or(scene.backdrop);
    scene
}

fn apply_light(light: &mut PunctualLight, edit: &LightEdit) {
    if let Some(intensity) = edit.intensity.filter(|intensity| intensity.is_finite()) {
        light.intensity = intensity.max(Vec3::ZERO);
    }
    if edit.translation.is_finite() {
        light.position += edit.translation;
    }
    let Some(angle) = edit.angle.filter(|angle| angle.is_finite()) else { return };
    match &mut light.kind {
        PunctualKind::Point => {}
        PunctualKind::Spot { inner_angle, outer_angle } => {
            *outer_angle = angle.clamp(1e-4, std::f32::consts::FRAC_PI_2);
            *inner_angle = inner_angle.min(*outer_angle);
        }
        PunctualKind::Directional { angular_diameter } => {
            *angular_diameter = angle.clamp(0.0, std::f32::consts::FRAC_PI_2);
        }
    }
}

fn apply_environment(environment: &mut Environment, edit: &EnvironmentEdit, image: Option<&Arc<EnvironmentImage>>) {
    if let Some(image) = image {
        *environment = Environment::Image { image: Arc::clone(image), rotation_deg: 0.0, intensity: 1.0 };
    }
    match environment {
        Environment::Constant(radiance) => {
            if let Some(edited) = edit.radiance.filter(|radiance| radiance.is_finite()) {
                *radiance = edited.max(Vec3::ZERO);
            }
        }
        Environment::Image { rotation_deg, intensity, .. } => {
            if let Some(edited) = edit.rotation_deg.filter(|angle| angle.is_finite()) {
                *rotation_deg = edited;
            }
            if let Some(edited) = edit.intensity.filter(|intensity| intensity.is_finite()) {
                *intensity = edited.max(0.0);
            }
        }
    }
}
