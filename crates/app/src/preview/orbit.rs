//! Movements about a point of the scene: orbit, pan, dolly and framing, as functions of a standpoint.
//!
//! None of them rolls the view or changes its angle. The pivot is a point of the world in front of the viewer; its distance
//! is what makes the speed of all of them follow the scene's scale.

use glam::{Vec2, Vec3};

use super::navigation::Standpoint;
use crate::view::View;

/// Nearest that a dolly comes to its pivot, as a part of the scene's diagonal.
const NEAREST: f32 = 1e-5;
/// Farthest that it goes, in diagonals of the scene.
const FARTHEST: f32 = 100.0;
/// Room about what is framed, as a factor of its radius.
const MARGIN: f32 = 1.15;

impl Standpoint {
    /// Turns about `pivot` by `turn` radians, x to the right and y up in yaw and pitch. The pivot keeps its distance and its
    /// place in the view; the pitch stops at +-90 degrees.
    #[must_use]
    pub fn orbited(self, pivot: Vec3, turn: Vec2) -> Self {
        let in_view = self.view.film_from_view().inverse() * (pivot - self.position);
        let view = View::along_angles(self.view.yaw + turn.x, self.view.pitch + turn.y, self.view.tan_half);
        Self { position: pivot - view.film_from_view() * in_view, view }
    }

    /// Moves in the image plane so that `pivot`, whose depth stays, comes to lie at a point of the view. Nothing moves when the
    /// pivot lies behind the viewer.
    #[must_use]
    pub fn panned(self, pivot: Vec3, point: Vec2) -> Self {
        let film_from_view = self.view.film_from_view();
        let depth = -(film_from_view.inverse() * (pivot - self.position)).z;
        if depth <= 0.0 {
            return self;
        }
        let in_view = (point * self.view.tan_half * depth).extend(-depth);
        Self { position: pivot - film_from_view * in_view, ..self }
    }

    /// Scales the distance to `pivot`, which keeps its place in the view. The distance stays within what makes sense in a scene
    /// of this diagonal, metres.
    #[must_use]
    pub fn dollied(self, pivot: Vec3, factor: f32, diagonal: f32) -> Self {
        let offset = self.position - pivot;
        let distance = offset.length();
        if distance <= 0.0 {
            return self;
        }
        let (nearest, farthest) = (NEAREST * diagonal, FARTHEST * diagonal);
        // From beyond the limits one may come back, and go no farther.
        let wanted = (distance * factor).clamp(nearest.min(distance), farthest.max(distance));
        Self { position: pivot + offset * (wanted / distance), ..self }
    }

    /// Moves back or forth without turning until a ball of this centre and radius (metres) fills the view.
    #[must_use]
    pub fn framed(self, centre: Vec3, radius: f32) -> Self {
        let narrow = self.view.tan_half.min_element().atan();
        let distance = radius.max(1e-6) * MARGIN / narrow.sin();
        Self { position: centre - self.view.direction_at(Vec2::ZERO) * distance, ..self }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn standpoint() -> Standpoint {
        Standpoint { position: Vec3::new(1.0, 2.0, 7.0), view: View::new(0.4, -0.3, 1.2, 0.8) }
    }

    fn place(standpoint: &Standpoint, point: Vec3) -> Vec2 {
        standpoint.view.point_of(point - standpoint.position).unwrap()
    }

    /// A point of the world at a distance, seen at a place of the view.
    fn seen_at(standpoint: &Standpoint, at: Vec2, distance: f32) -> Vec3 {
        standpoint.position + standpoint.view.direction_at(at) * distance
    }

    #[test]
    fn an_orbit_keeps_the_pivots_distance_and_place() {
        let start = standpoint();
        for at in [Vec2::ZERO, Vec2::new(0.7, -0.4)] {
            let pivot = seen_at(&start, at, 5.0);
            for turn in [Vec2::new(0.5, 0.0), Vec2::new(-3.0, 0.4), Vec2::new(0.1, -0.9)] {
                let moved = start.orbited(pivot, turn);
                assert!((moved.position.distance(pivot) - 5.0).abs() < 1e-4, "{turn}");
                assert!(place(&moved, pivot).distance(at) < 1e-4, "{turn}");
                assert!(moved.position.distance(start.position) > 0.1, "{turn}");
            }
        }
    }

    #[test]
    fn turning_the_view_to_the_right_goes_to_the_left_about_the_pivot() {
        let start = Standpoint { position: Vec3::new(0.0, 0.0, 5.0), view: View::new(0.0, 0.0, 1.0, 1.0) };
        let left = start.orbited(Vec3::ZERO, Vec2::new(std::f32::consts::FRAC_PI_2, 0.0));
        assert!(left.position.distance(Vec3::new(-5.0, 0.0, 0.0)) < 1e-4, "{}", left.position);
        let above = start.orbited(Vec3::ZERO, Vec2::new(0.0, -2.0));
        assert!(above.position.distance(Vec3::new(0.0, 5.0, 0.0)) < 1e-3, "it stops above: {}", above.position);
    }

    #[test]
    fn a_pan_takes_the_pivot_along_and_keeps_its_depth() {
        let start = standpoint();
        let pivot = seen_at(&start, Vec2::new(0.2, 0.1), 3.0);
        let depth = |s: &Standpoint| s.view.direction_at(Vec2::ZERO).dot(pivot - s.position);
        for at in [Vec2::new(0.2, 0.1), Vec2::new(-0.9, 0.6), Vec2::new(1.5, -1.0)] {
            let moved = start.panned(pivot, at);
            assert!(place(&moved, pivot).distance(at) < 1e-4, "{at}");
            assert!((depth(&moved) - depth(&start)).abs() < 1e-4 && moved.view == start.view);
        }
        let behind = seen_at(&start, Vec2::ZERO, -3.0);
        assert_eq!(start.panned(behind, Vec2::ONE), start);
    }

    #[test]
    fn a_dolly_keeps_the_pivots_place_and_stays_in_reach() {
        let start = standpoint();
        let at = Vec2::new(-0.5, 0.3);
        let pivot = seen_at(&start, at, 4.0);
        let closer = start.dollied(pivot, 0.5, 10.0);
        assert!((closer.position.distance(pivot) - 2.0).abs() < 1e-4 && place(&closer, pivot).distance(at) < 1e-4);
        let mut near = start;
        let mut far = start;
        for _ in 0..100 {
            near = near.dollied(pivot, 0.5, 10.0);
            far = far.dollied(pivot, 2.0, 10.0);
        }
        assert!((near.position.distance(pivot) - 1e-4).abs() < 1e-5, "{}", near.position.distance(pivot));
        assert!((far.position.distance(pivot) - 1000.0).abs() < 1.0);
    }

    #[test]
    fn what_is_framed_is_in_the_middle_and_whole() {
        let (centre, radius) = (Vec3::new(-3.0, 1.0, 2.0), 0.4);
        let framed = standpoint().framed(centre, radius);
        assert!(place(&framed, centre).length() < 1e-4 && framed.view == standpoint().view);
        // A ball's outline reaches farther in the image plane than its radius at the centre's depth.
        let half = (radius / framed.position.distance(centre)).asin().tan() / framed.view.tan_half.min_element();
        assert!((0.7..1.0).contains(&half), "{half}");
    }
}
