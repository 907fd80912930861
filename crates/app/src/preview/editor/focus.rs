//! What movements of the view go about: what is selected, what lies under the pointer, or the scene as a whole.

use std::collections::BTreeSet;
use std::sync::Arc;

use egui::{Pos2, Rect};
use glam::Vec3;
use tracer::scene::Scene;

use super::Editor;
use crate::document::edits::Part;
use crate::preview::navigation::{Standpoint, point_in_view};

/// A light has no size; it is framed as a ball of this part of the scene's diagonal.
const LIGHT_SIZE: f32 = 0.02;

impl Editor {
    /// The point of the world about which a movement that begins at a place of the window goes: the middle of the selection,
    /// else what lies under the pointer, else a point in its direction as far away as the scene's middle.
    pub fn pivot(&mut self, pointer: Pos2, rect: Rect, standpoint: &Standpoint) -> Vec3 {
        let ahead = |point: &Vec3| standpoint.view.point_of(*point - standpoint.position).is_some();
        if let Some((centre, _)) = self.selection_ball().filter(|(centre, _)| ahead(centre)) {
            return centre;
        }
        let direction = standpoint.view.direction_at(point_in_view(rect, pointer));
        let version = Arc::clone(self.document.version());
        let hit = self.picker.pick(&version, standpoint.position, direction).map(|hit| hit.distance);
        let (centre, radius) = ball(&version);
        let far = centre.distance(standpoint.position).max(0.1 * radius);
        standpoint.position + direction * hit.unwrap_or(far)
    }

    /// Centre and radius, metres, of what is selected, or of all that is visible.
    pub fn focus(&self) -> (Vec3, f32) {
        self.selection_ball().unwrap_or_else(|| ball(self.document.version()))
    }

    fn selection_ball(&self) -> Option<(Vec3, f32)> {
        let version = self.document.version();
        match self.panel.selected? {
            Part::Node(node) => {
                let below: BTreeSet<u32> = self.document.tree().below(node).into_iter().collect();
                let instances = version.instances.iter().filter(|instance| below.contains(&instance.node));
                let alone = Scene { instances: instances.cloned().collect(), ..(**version).clone() };
                alone.bounds().map(ball_about)
            }
            Part::Light(light) => {
                let light = version.lights.get(light as usize)?;
                Some((light.position, ball(version).1 * LIGHT_SIZE))
            }
            Part::Material(_) | Part::Environment => None,
        }
    }
}

/// A ball about all that is visible.
fn ball(scene: &Scene) -> (Vec3, f32) {
    ball_about(scene.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE)))
}

fn ball_about((low, high): (Vec3, Vec3)) -> (Vec3, f32) {
    ((low + high) * 0.5, (high - low).length() * 0.5)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::Cli;
    use crate::preview::editor::panel::Action;
    use crate::session::{self, Source};
    use crate::view::View;

    #[test]
    fn movements_go_about_the_selection_else_about_what_is_under_the_pointer() {
        let loaded = session::load(&Source::BuiltIn, &Cli::parse_from(["fovea"]).preview.scene).unwrap();
        let camera = session::viewpoints(&loaded.scene)[0].clone();
        let standpoint =
            Standpoint { position: camera.position, view: View::along(camera.rotation, camera.vfov, 16.0 / 9.0) };
        let rect = Rect::from_min_size(Pos2::ZERO, egui::vec2(1280.0, 720.0));
        let pointer = egui::pos2(340.0, 560.0);
        // Not `Editor::open`, which looks for saved edits in the working folder.
        let mut editor = Editor::new(&Source::BuiltIn, &loaded);
        let under = editor.pivot(pointer, rect, &standpoint);
        let at = standpoint.view.point_of(under - standpoint.position).unwrap();
        assert!(at.distance(point_in_view(rect, pointer)) < 1e-3, "{at}");
        let everything = editor.focus();

        let direction = standpoint.view.direction_at(point_in_view(rect, pointer));
        let hit = editor.picker.pick(&loaded.scene, standpoint.position, direction).unwrap();
        let node = loaded.scene.instances[hit.instance as usize].node;
        editor.act(Action::Select(Some(Part::Node(node))));
        let (centre, radius) = editor.focus();
        assert!(centre.distance(under) <= radius * 1.001, "the hit is on what is selected");
        assert!(radius < 0.2 * everything.1, "{radius} of {}", everything.1);
        assert_eq!(editor.pivot(egui::pos2(1000.0, 100.0), rect, &standpoint), centre);
    }
}
