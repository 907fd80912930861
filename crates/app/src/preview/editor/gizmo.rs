//! Handles at the selected object: arrows, rings or boxes, dragged with the pointer.
//!
//! Everything here is geometry of the view: where a handle is, which one is near the pointer, and what a drag does to a
//! [`Move`]. Points in the view are +-1 at its edges, y up.

use egui::{Color32, Painter, Pos2, Rect, Stroke};
use glam::{Affine3A, Mat3A, Quat, Vec3};

use crate::document::edits::Move;
use crate::preview::navigation::{Standpoint, point_in_view, point_in_window};

/// Length of an axis, as a part of the view's height.
const LENGTH: f32 = 0.16;
/// Near enough to a handle, points.
const REACH: f32 = 9.0;
/// Points of a ring.
const RING_STEPS: u16 = 64;
/// Colours of the axes, as in other programs: x red, y green, z blue.
const COLOURS: [Color32; 3] =
    [Color32::from_rgb(232, 84, 84), Color32::from_rgb(120, 196, 84), Color32::from_rgb(92, 142, 240)];

/// What a drag does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GizmoMode {
    /// Moves along an axis.
    #[default]
    Move,
    /// Turns about an axis.
    Rotate,
    /// Stretches along an axis.
    Scale,
}

impl GizmoMode {
    /// All, with their names.
    pub const LIST: [(Self, &'static str); 3] =
        [(Self::Move, "Move"), (Self::Rotate, "Rotate"), (Self::Scale, "Scale")];

    /// The one after.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Move => Self::Rotate,
            Self::Rotate => Self::Scale,
            Self::Scale => Self::Move,
        }
    }
}

/// Handles about a point of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gizmo {
    /// What a drag does.
    pub mode: GizmoMode,
    /// Where the object is, metres.
    pub pivot: Vec3,
    /// Unit axes of the world, or of the object where it is scaled.
    pub axes: [Vec3; 3],
    /// Length of an axis, metres.
    length: f32,
}

/// A drag that has begun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag {
    gizmo: Gizmo,
    axis: usize,
    start: Move,
    /// Where along or about the axis the pointer took hold: metres, radians.
    held: f32,
    /// World of the edits above the object from the file's world.
    above: Affine3A,
}

impl Gizmo {
    /// Handles for an object at `pivot` with these axes of its own; `None` behind the eye or at it.
    pub fn new(mode: GizmoMode, pivot: Vec3, own_axes: [Vec3; 3], standpoint: &Standpoint) -> Option<Self> {
        let offset = pivot - standpoint.position;
        let ahead = standpoint.view.film_from_view().inverse() * offset;
        if ahead.z >= -1e-6 || !pivot.is_finite() {
            return None;
        }
        let length = -ahead.z * standpoint.view.tan_half.y * 2.0 * LENGTH;
        let axes = if mode == GizmoMode::Scale { own_axes } else { Vec3::AXES };
        Some(Self { mode, pivot, axes, length })
    }

    /// The handle under the pointer, by its axis.
    pub fn at(&self, pointer: Pos2, rect: Rect, standpoint: &Standpoint) -> Option<usize> {
        let distance = |axis: usize| {
            let line = self.line(axis, rect, standpoint);
            line.windows(2).map(|ends| distance_to_segment(pointer, ends[0], ends[1])).fold(f32::INFINITY, f32::min)
        };
        let nearest = (0..3).map(|axis| (axis, distance(axis))).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (nearest.1 <= REACH).then_some(nearest.0)
    }

    /// Takes hold of a handle.
    pub fn grab(
        &self,
        axis: usize,
        pointer: Pos2,
        rect: Rect,
        standpoint: &Standpoint,
        start: Move,
        above: Affine3A,
    ) -> Option<Drag> {
        let held = self.parameter(axis, pointer, rect, standpoint)?;
        Some(Drag { gizmo: *self, axis, start, held, above })
    }

    /// Where the pointer is along an axis (metres from the pivot) or about it (radians).
    fn parameter(&self, axis: usize, pointer: Pos2, rect: Rect, standpoint: &Standpoint) -> Option<f32> {
        let ray = standpoint.view.direction_at(point_in_view(rect, pointer));
        let along = self.axes[axis];
        let from_pivot = standpoint.position - self.pivot;
        if self.mode == GizmoMode::Rotate {
            let facing = ray.dot(along);
            // A ring seen from its edge says nothing about the angle.
            if facing.abs() < 1e-3 {
                return None;
            }
            let in_plane = from_pivot - ray * (from_pivot.dot(along) / facing);
            let x = along.any_orthonormal_vector();
            let (x, y) = (x, along.cross(x));
            return Some(in_plane.dot(y).atan2(in_plane.dot(x)));
        }
        // The point of the axis that is nearest to the ray.
        let cos = ray.dot(along);
        let denominator = 1.0 - cos * cos;
        if denominator < 1e-4 {
            return None;
        }
        Some((from_pivot.dot(along) - from_pivot.dot(ray) * cos) / denominator)
    }

    /// A handle's line in the window; empty where it is behind the eye.
    fn line(&self, axis: usize, rect: Rect, standpoint: &Standpoint) -> Vec<Pos2> {
        let project = |point: Vec3| {
            let direction = point - standpoint.position;
            standpoint.view.point_of(direction).map(|point| point_in_window(rect, point))
        };
        let along = self.axes[axis] * self.length;
        let points: Vec<Vec3> = match self.mode {
            GizmoMode::Move | GizmoMode::Scale => vec![self.pivot, self.pivot + along],
            GizmoMode::Rotate => {
                let x = self.axes[axis].any_orthonormal_vector() * self.length;
                let turn = |step: u16| std::f32::consts::TAU * f32::from(step) / f32::from(RING_STEPS);
                let point = |step| self.pivot + Quat::from_axis_angle(self.axes[axis], turn(step)) * x;
                (0..=RING_STEPS).map(point).collect()
            }
        };
        points.into_iter().map(project).collect::<Option<_>>().unwrap_or_default()
    }

    /// Draws the handles; `lit` is under the pointer or held.
    pub fn draw(&self, painter: &Painter, rect: Rect, standpoint: &Standpoint, lit: Option<usize>) {
        for (axis, colour) in COLOURS.into_iter().enumerate() {
            let line = self.line(axis, rect, standpoint);
            let Some(&end) = line.last() else { continue };
            let (width, colour) = if lit == Some(axis) { (3.5, Color32::WHITE) } else { (2.0, colour) };
            painter.line(line.clone(), Stroke::new(width + 2.0, Color32::from_black_alpha(110)));
            painter.line(line.clone(), Stroke::new(width, colour));
            match self.mode {
                GizmoMode::Move => {
                    let direction = (end - line[0]).normalized();
                    let head = [direction * 12.0, direction.rot90() * 5.0, direction.rot90() * -5.0];
                    let head = head.map(|corner| end + corner).to_vec();
                    painter.add(egui::Shape::convex_polygon(head, colour, Stroke::NONE));
                }
                GizmoMode::Scale => {
                    painter.rect_filled(Rect::from_center_size(end, egui::Vec2::splat(9.0)), 1.0, colour);
                }
                GizmoMode::Rotate => {}
            }
        }
    }
}

impl Drag {
    /// The handle that is held.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Where the object is with the pointer here. A pointer that says nothing leaves it where it was at first.
    pub fn moved(&self, pointer: Pos2, rect: Rect, standpoint: &Standpoint) -> Move {
        let Some(now) = self.gizmo.parameter(self.axis, pointer, rect, standpoint) else { return self.start };
        let axis = self.gizmo.axes[self.axis];
        // What hangs on something that is moved is moved in the file's axes.
        let file_from_world = self.above.matrix3.inverse();
        let in_file =
            |direction: Vec3| if file_from_world.is_finite() { file_from_world * direction } else { direction };
        let moved = match self.gizmo.mode {
            GizmoMode::Move => {
                let translation = self.start.translation + in_file(axis * (now - self.held));
                Move { translation, ..self.start }
            }
            GizmoMode::Rotate => {
                let axis = in_file(axis).normalize_or(axis);
                Move { rotation: Quat::from_axis_angle(axis, now - self.held) * self.start.rotation, ..self.start }
            }
            GizmoMode::Scale => {
                let factor = if self.held.abs() > 1e-6 { now / self.held } else { 1.0 };
                let mut scale = self.start.scale;
                scale[self.axis] *= factor;
                Move { scale, ..self.start }
            }
        };
        moved.sane()
    }
}

/// The unit axes of a transform; those of the world where it has none.
pub fn axes_of(matrix: Mat3A) -> [Vec3; 3] {
    let axis = |index: usize| Vec3::from(matrix.col(index)).normalize_or(Vec3::AXES[index]);
    [axis(0), axis(1), axis(2)]
}

fn distance_to_segment(point: Pos2, from: Pos2, to: Pos2) -> f32 {
    let along = to - from;
    let t = ((point - from).dot(along) / along.length_sq().max(1e-12)).clamp(0.0, 1.0);
    point.distance(from + along * t)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::view::View;

    fn rect() -> Rect {
        Rect::from_min_size(Pos2::ZERO, egui::vec2(1280.0, 720.0))
    }

    fn standpoint() -> Standpoint {
        Standpoint { position: Vec3::new(1.0, 2.0, 6.0), view: View::new(0.1, -0.2, 1.0, 0.7) }
    }

    fn window_point(point: Vec3) -> Pos2 {
        let standpoint = standpoint();
        point_in_window(rect(), standpoint.view.point_of(point - standpoint.position).unwrap())
    }

    #[test]
    fn a_drag_along_an_axis_follows_the_pointer() {
        let pivot = Vec3::new(1.2, 1.0, 0.0);
        for axis in 0..3 {
            let gizmo = Gizmo::new(GizmoMode::Move, pivot, Vec3::AXES, &standpoint()).unwrap();
            let along = Vec3::AXES[axis];
            let from = window_point(pivot + along * gizmo.length * 0.7);
            assert_eq!(gizmo.at(from, rect(), &standpoint()), Some(axis));
            let start = Move { translation: Vec3::splat(0.5), ..Move::default() };
            let drag = gizmo.grab(axis, from, rect(), &standpoint(), start, Affine3A::IDENTITY).unwrap();
            let to = window_point(pivot + along * (gizmo.length * 0.7 + 0.8));
            let moved = drag.moved(to, rect(), &standpoint());
            assert!(moved.translation.distance(start.translation + along * 0.8) < 1e-3, "{moved:?}");
            assert_eq!(moved.rotation, start.rotation);
        }
    }

    #[test]
    fn a_drag_about_an_axis_turns_as_far_as_the_pointer() {
        let pivot = Vec3::new(1.2, 1.0, 0.0);
        let gizmo = Gizmo::new(GizmoMode::Rotate, pivot, Vec3::AXES, &standpoint()).unwrap();
        for axis in 0..3 {
            let along = Vec3::AXES[axis];
            let held = along.any_orthonormal_vector() * gizmo.length;
            let at = |angle: f32| window_point(pivot + Quat::from_axis_angle(along, angle) * held);
            let drag = gizmo.grab(axis, at(0.2), rect(), &standpoint(), Move::default(), Affine3A::IDENTITY).unwrap();
            let moved = drag.moved(at(0.9), rect(), &standpoint());
            assert!(moved.rotation.angle_between(Quat::from_axis_angle(along, 0.7)) < 2e-3, "{axis} {moved:?}");
        }
    }

    #[test]
    fn scaling_goes_along_the_objects_own_axis() {
        let own = axes_of(Mat3A::from_quat(Quat::from_rotation_y(0.6)));
        let pivot = Vec3::new(1.2, 1.0, 0.0);
        let gizmo = Gizmo::new(GizmoMode::Scale, pivot, own, &standpoint()).unwrap();
        let at = |length: f32| window_point(pivot + own[1] * length);
        let start = Move { scale: Vec3::splat(2.0), ..Move::default() };
        let drag = gizmo.grab(1, at(0.5), rect(), &standpoint(), start, Affine3A::IDENTITY).unwrap();
        let moved = drag.moved(at(0.75), rect(), &standpoint());
        assert!(moved.scale.distance(Vec3::new(2.0, 3.0, 2.0)) < 1e-3, "{moved:?}");
        // Through the pivot to the other side mirrors, but never flattens.
        let flat = drag.moved(at(0.0), rect(), &standpoint());
        assert!(flat.scale.y != 0.0);
    }

    #[test]
    fn below_a_turned_group_the_object_still_follows_the_pointer() {
        let pivot = Vec3::new(1.2, 1.0, 0.0);
        let above = Affine3A::from_quat(Quat::from_rotation_y(1.0));
        let gizmo = Gizmo::new(GizmoMode::Move, pivot, Vec3::AXES, &standpoint()).unwrap();
        let at = |length: f32| window_point(pivot + Vec3::X * length);
        let drag = gizmo.grab(0, at(0.2), rect(), &standpoint(), Move::default(), above).unwrap();
        let moved = drag.moved(at(0.6), rect(), &standpoint());
        let in_world = above.transform_vector3(moved.translation);
        assert!(in_world.distance(Vec3::X * 0.4) < 1e-3, "{in_world}");
    }

    #[test]
    fn there_are_no_handles_behind_the_eye() {
        let behind = standpoint().position + Vec3::Z;
        assert_eq!(Gizmo::new(GizmoMode::Move, behind, Vec3::AXES, &standpoint()), None);
        assert_eq!(Gizmo::new(GizmoMode::Move, Vec3::NAN, Vec3::AXES, &standpoint()), None);
    }
}
