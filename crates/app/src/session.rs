//! What the window and the headless commands have in common: opening a scene and finding a place to look from.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use glam::{Quat, Vec3};
use tracer::import::{ImportOptions, ImportReport, ImportWarning, SceneNode};
use tracer::scene::{Backdrop, Environment, Projection, PunctualKind, Scene};

use crate::cli::values::CameraChoice;
use crate::cli::{FileArgs, SceneArgs};

/// Vertical angle of view where a camera has none, radians.
const DEFAULT_VFOV: f32 = 50.0 * std::f32::consts::PI / 180.0;
/// From where a camera that frames the scene looks at its centre: from the right, above and in front.
const FRAMING_DIRECTION: Vec3 = Vec3::new(0.5, 0.35, 1.0);

/// Where a scene comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// The scene inside the program.
    BuiltIn,
    /// A glTF file.
    File(PathBuf),
}

impl Source {
    /// What a person calls it.
    pub fn name(&self) -> String {
        match self {
            Self::BuiltIn => "the built-in scene".into(),
            Self::File(path) => path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
        }
    }

    /// Whether both are the same scene, however its file is named.
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::File(own), Self::File(others)) => {
                let place = |path: &Path| std::fs::canonicalize(path).ok();
                own == others || place(own).is_some_and(|own| Some(own) == place(others))
            }
            _ => self == other,
        }
    }
}

impl From<Option<&Path>> for Source {
    fn from(path: Option<&Path>) -> Self {
        path.map_or(Self::BuiltIn, |path| Self::File(path.to_owned()))
    }
}

/// A camera of the scene, or the one that frames it.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// The camera's name; `framing` for the one made up.
    pub name: String,
    /// Metres, in the scene's space.
    pub position: Vec3,
    /// World from camera; it looks along -Z.
    pub rotation: Quat,
    /// Vertical angle of view, radians.
    pub vfov: f32,
}

/// A scene with what there is to say about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene in its environment.
    pub scene: Arc<Scene>,
    /// What was not supported, repaired or replaced, one line each.
    pub notes: Vec<String>,
    /// The file's nodes, which make the scene's tree; instances refer to them.
    pub nodes: Vec<SceneNode>,
    /// All files that were read, the scene's own first.
    pub files: Vec<PathBuf>,
    /// Images that did not decode, one line each: they may be half written.
    pub replaced_images: Vec<String>,
    /// The camera that the command line asks for.
    pub camera: Option<CameraChoice>,
}

/// What is known of a scene before its images are read.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// Fit for a sketch, as [`tracer::import::load_gltf_showing`] has it.
    pub scene: Arc<Scene>,
    /// The camera that the command line asks for.
    pub camera: Option<CameraChoice>,
}

/// Loads a scene and puts the environment that was asked for around it. Scene, moment, variant and camera of the command line
/// are those of the file that it names: they do not count for another one.
///
/// # Errors
/// When the scene or the environment image cannot be read.
pub fn load(source: &Source, args: &SceneArgs) -> anyhow::Result<Loaded> {
    load_showing(source, args, |_| ())
}

/// As [`load`], and hands on what the scene is before its images are read, which goes on when `show` returns.
///
/// # Errors
/// As [`load`], also after `show` was called.
pub fn load_showing(source: &Source, args: &SceneArgs, show: impl FnOnce(Shapes)) -> anyhow::Result<Loaded> {
    let is_named = source.is(&Source::from(args.scene.as_deref()));
    let (file, camera) = if is_named { (args.file.clone(), args.camera.clone()) } else { Default::default() };
    let (mut scene, report) =
        import_showing(source, &file, |scene| show(Shapes { scene: Arc::new(scene.clone()), camera: camera.clone() }))?;
    let mut warnings = report.warnings;
    let mut repaired = None;
    let environment = match (&args.background, &args.env) {
        (Some(background), _) => Some(Environment::Constant(Vec3::from_array(background.0))),
        (None, Some(path)) => {
            let loaded = tracer::environment::load(path)?;
            repaired = (loaded.repaired_texels > 0).then(|| {
                format!(
                    "{}: {} texels were negative or not finite and became 0",
                    path.display(),
                    loaded.repaired_texels
                )
            });
            let image = Arc::new(loaded.image);
            Some(Environment::Image { image, rotation_deg: args.env_rotate, intensity: 1.0 })
        }
        (None, None) => None,
    };
    if let Some(environment) = environment {
        scene.environment = environment;
        warnings.retain(|warning| *warning != ImportWarning::NoLight);
    }
    if let Some(backdrop) = args.backdrop {
        scene.backdrop = Backdrop::Color(Vec3::from_array(backdrop.0));
    }
    for light in &mut scene.lights {
        if let PunctualKind::Directional { angular_diameter } = &mut light.kind {
            *angular_diameter = args.sun_angle.to_radians();
        }
    }
    let is_replaced = |warning: &&ImportWarning| matches!(warning, ImportWarning::ImageReplaced { .. });
    let replaced_images = warnings.iter().filter(is_replaced).map(ToString::to_string).collect();
    let notes = warnings.iter().map(ToString::to_string).chain(repaired).collect();
    let files = report.files.into_iter().chain(args.env.clone()).collect();
    Ok(Loaded { scene: Arc::new(scene), notes, nodes: report.nodes, files, replaced_images, camera })
}

/// Reads a scene as it is.
///
/// # Errors
/// When it cannot be read.
pub fn import(source: &Source, args: &FileArgs) -> anyhow::Result<(Scene, ImportReport)> {
    import_showing(source, args, |_| ())
}

/// What of a file is shown says nothing of the built-in scene.
///
/// # Errors
/// When something of a file was asked for; the option is named.
pub fn check_built_in(args: &FileArgs) -> anyhow::Result<()> {
    let asked = [
        ("--gltf-scene", args.gltf_scene.is_some()),
        ("--time", args.time.is_some()),
        ("--variant", args.variant.is_some()),
    ];
    match asked.into_iter().find(|(_, is_asked)| *is_asked) {
        Some((option, _)) => bail!("{option} is for a glTF file, and the built-in scene is none"),
        None => Ok(()),
    }
}

fn import_showing(
    source: &Source,
    args: &FileArgs,
    shapes: impl FnOnce(&Scene),
) -> anyhow::Result<(Scene, ImportReport)> {
    let options = ImportOptions { scene: args.gltf_scene, time_secs: args.time, variant: args.variant.clone() };
    match source {
        Source::BuiltIn => {
            check_built_in(args)?;
            let (scene, report) = tracer::builtin::scene().context("the built-in scene")?;
            shapes(&scene);
            Ok((scene, report))
        }
        Source::File(path) => Ok(tracer::import::load_gltf_showing(path, &options, shapes)?),
    }
}

/// The scene's cameras, or the one that frames it.
pub fn viewpoints(scene: &Scene) -> Vec<Viewpoint> {
    let cameras: Vec<_> = scene
        .cameras
        .iter()
        .enumerate()
        .map(|(index, camera)| Viewpoint {
            name: if camera.name.is_empty() { format!("camera {index}") } else { camera.name.clone() },
            position: camera.position,
            rotation: camera.rotation,
            vfov: match camera.projection {
                Projection::Perspective { yfov, .. } => yfov,
                Projection::Orthographic { .. } => DEFAULT_VFOV,
            },
        })
        .collect();
    if cameras.is_empty() { vec![framing(scene)] } else { cameras }
}

/// The place of a camera in [`viewpoints`]; the first unless one is asked for.
pub fn choose(viewpoints: &[Viewpoint], choice: Option<&CameraChoice>) -> anyhow::Result<usize> {
    let known = || viewpoints.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>().join(", ");
    match choice {
        None => Ok(0),
        Some(&CameraChoice::Index(index)) if index < viewpoints.len() => Ok(index),
        Some(CameraChoice::Index(index)) => {
            bail!("--camera {index}: the scene has {}, counted from 0: {}", viewpoints.len(), known())
        }
        Some(CameraChoice::Name(name)) => viewpoints
            .iter()
            .position(|camera| camera.name == *name)
            .with_context(|| format!("--camera {name}: no such camera; there are: {}", known())),
    }
}

/// A camera that sees the whole scene.
fn framing(scene: &Scene) -> Viewpoint {
    let (low, high) = scene.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
    let radius = (high - low).length().max(1e-6) * 0.5;
    let backwards = FRAMING_DIRECTION.normalize();
    let position = (low + high) * 0.5 + backwards * (radius / (DEFAULT_VFOV * 0.5).sin());
    let rotation = glam::Mat3::from_cols(
        Vec3::Y.cross(backwards).normalize(),
        backwards.cross(Vec3::Y.cross(backwards).normalize()),
        backwards,
    );
    Viewpoint { name: "framing".into(), position, rotation: Quat::from_mat3(&rotation), vfov: DEFAULT_VFOV }
}

/// Number of visible triangles, instances counted as often as they are placed.
pub fn triangles(scene: &Scene) -> u64 {
    let visible = scene.instances.iter().filter(|instance| instance.visible);
    visible
        .filter_map(|instance| scene.meshes.get(instance.mesh as usize))
        .map(|mesh| mesh.triangles.len() as u64)
        .sum()
}

/// An error with its causes as one line; a cause that the text before it ends with already is not said twice.
pub fn one_line(error: &anyhow::Error) -> String {
    let text = error.chain().map(ToString::to_string).fold(String::new(), |text, cause| match text.as_str() {
        "" => cause,
        before if before.ends_with(&cause) => text,
        before => format!("{before}: {cause}"),
    });
    text.split(['\n', '\r']).map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use glam::{Affine3A, DVec3, Vec2};
    use tracer::scene::{ContentHash, Instance, Material, Mesh};

    use super::*;
    use crate::view::View;

    #[test]
    fn a_cause_is_said_once() {
        let cause = || std::io::Error::other("gone");
        assert_eq!(one_line(&anyhow::Error::from(cause()).context("a.glb")), "a.glb: gone");
        assert_eq!(one_line(&anyhow::Error::from(cause()).context("a.glb: gone")), "a.glb: gone");
    }

    /// A triangle in the unit cube's corner, moved by 10 m and made twice as large, and a hidden one far away.
    fn scene() -> Scene {
        let mesh = Mesh {
            name: String::new(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::ONE],
            normals: vec![Vec3::Z; 3],
            tangents: vec![],
            uvs: [vec![], vec![]],
            colors: vec![],
            triangles: vec![[0, 1, 2]],
            hash: ContentHash::default(),
        };
        let instance = |offset: f32, visible| Instance {
            name: String::new(),
            mesh: 0,
            material: 0,
            world_from_mesh: Affine3A::from_scale_rotation_translation(
                Vec3::splat(2.0),
                Quat::IDENTITY,
                Vec3::splat(offset),
            ),
            visible,
            node: 0,
        };
        Scene {
            name: "test".into(),
            meshes: vec![Arc::new(mesh)],
            textures: vec![],
            materials: vec![Arc::new(Material::default())],
            instances: vec![instance(10.0, true), instance(1000.0, false)],
            lights: vec![],
            cameras: vec![],
            environment: Environment::Constant(Vec3::ONE),
            backdrop: Backdrop::default(),
            origin_in_file: DVec3::ZERO,
        }
    }

    #[test]
    fn bounds_are_those_of_what_is_visible() {
        let (low, high) = scene().bounds().unwrap();
        assert!(low.distance(Vec3::splat(10.0)) < 1e-5 && high.distance(Vec3::splat(12.0)) < 1e-5);
        assert_eq!(triangles(&scene()), 1);
        assert_eq!(Scene { instances: vec![], ..scene() }.bounds(), None);
    }

    #[test]
    fn without_a_camera_the_scene_is_framed() {
        let scene = scene();
        let found = viewpoints(&scene);
        assert_eq!(found.len(), 1);
        let view = View::along(found[0].rotation, found[0].vfov, 1.0);
        let (low, high) = scene.bounds().unwrap();
        for corner in [low, high, Vec3::new(low.x, high.y, low.z), (low + high) * 0.5] {
            let point = view.point_of((corner - found[0].position).normalize()).unwrap();
            assert!(point.abs().cmple(Vec2::ONE).all(), "{corner} at {point}");
        }
    }

    #[test]
    fn cameras_are_found_by_place_and_name() {
        let named = |name: &str| Viewpoint { name: name.into(), ..framing(&scene()) };
        let cameras = [named("front"), named("back")];
        assert_eq!(choose(&cameras, None).unwrap(), 0);
        assert_eq!(choose(&cameras, Some(&CameraChoice::Index(1))).unwrap(), 1);
        assert_eq!(choose(&cameras, Some(&CameraChoice::Name("back".into()))).unwrap(), 1);
        for wrong in [CameraChoice::Index(2), CameraChoice::Name("top".into())] {
            let message = one_line(&choose(&cameras, Some(&wrong)).unwrap_err());
            assert!(message.contains("front, back"), "{message}");
        }
    }

    #[test]
    fn errors_are_one_line_with_their_causes() {
        let error = anyhow::anyhow!("first\n  second").context("outer");
        assert_eq!(one_line(&error), "outer: first; second");
    }
}
