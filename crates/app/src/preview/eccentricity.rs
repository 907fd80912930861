//! Rings of equal eccentricity: how far from the gaze the eye sees each place of the picture.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Shape, Stroke};
use glam::{Quat, Vec3};

use super::gaze::{Gaze, ScreenMapping};
use super::navigation::{Standpoint, point_in_window};
use crate::cli::choices::EccentricityAt;

/// Eccentricities that have a ring, degrees.
pub const RINGS_DEG: [f32; 6] = [2.0, 5.0, 10.0, 20.0, 30.0, 45.0];
/// Points of a ring.
const STEPS: u16 = 120;

/// A ring about the gaze as points of the window, the first one above the gaze and the last one again the first; `None` where it
/// leaves the plane of the picture.
pub fn ring(
    mapping: &ScreenMapping,
    standpoint: &Standpoint,
    rect: Rect,
    gaze: Gaze,
    at: EccentricityAt,
    degrees: f32,
) -> Vec<Option<Pos2>> {
    let (view, screen) = (standpoint.view, mapping.screen);
    let to_gaze = match at {
        EccentricityAt::Eye => screen.eye_direction(gaze.point * mapping.half_size_mm),
        EccentricityAt::Scene => view.direction_at(gaze.point),
    };
    let on_screen = |direction: Vec3| {
        let point = match at {
            EccentricityAt::Eye => screen.screen_point_mm(direction).map(|mm| mm / mapping.half_size_mm),
            EccentricityAt::Scene => view.point_of(direction),
        };
        point.map(|point| point_in_window(rect, point))
    };
    let up = match at {
        EccentricityAt::Eye => Vec3::Y,
        EccentricityAt::Scene => view.film_from_view() * Vec3::Y,
    };
    let right = to_gaze.cross(up).try_normalize().unwrap_or_else(|| to_gaze.any_orthonormal_vector());
    let top = Quat::from_axis_angle(right, degrees.to_radians()) * to_gaze;
    let turn = |step: u16| std::f32::consts::TAU * f32::from(step) / f32::from(STEPS);
    (0..=STEPS).map(|step| on_screen(Quat::from_axis_angle(to_gaze, turn(step)) * top)).collect()
}

/// Draws all rings with their degrees.
pub fn draw(
    painter: &Painter,
    mapping: &ScreenMapping,
    standpoint: &Standpoint,
    rect: Rect,
    gaze: Gaze,
    at: EccentricityAt,
) {
    for degrees in RINGS_DEG {
        let points = ring(mapping, standpoint, rect, gaze, at, degrees);
        for part in points.split(Option::is_none) {
            let part: Vec<Pos2> = part.iter().flatten().copied().collect();
            painter.add(Shape::line(part.clone(), Stroke::new(3.0, Color32::from_black_alpha(90))));
            painter.add(Shape::line(part, Stroke::new(1.0, Color32::from_white_alpha(150))));
        }
        // Above the gaze, below it, or where else the ring is in the picture.
        let quarters = [0, STEPS / 2, STEPS / 4, 3 * STEPS / 4].map(usize::from);
        let labels = quarters.into_iter().filter_map(|step| points.get(step).copied().flatten());
        if let Some(at) = labels.into_iter().find(|point| rect.shrink(10.0).contains(*point)) {
            let galley = painter.layout_no_wrap(format!("{degrees}°"), FontId::proportional(11.0), Color32::WHITE);
            let place = Align2::CENTER_CENTER.anchor_size(at, galley.size());
            painter.rect_filled(place.expand(2.0), 3.0, Color32::from_black_alpha(150));
            painter.galley(place.min, galley, Color32::WHITE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::screen::ScreenGeometry;
    use crate::view::View;
    use glam::Vec2;

    fn case() -> (ScreenMapping, Standpoint, Rect) {
        let rect = Rect::from_min_size(Pos2::ZERO, egui::vec2(1280.0, 720.0));
        let mapping = ScreenMapping::new(ScreenGeometry::default(), rect, Some(egui::vec2(1920.0, 1080.0)));
        let view = View::new(0.7, -0.3, 1.5, 0.9).with_aspect(1280.0 / 720.0);
        (mapping, Standpoint { position: Vec3::ZERO, view }, rect)
    }

    #[test]
    fn every_point_of_a_ring_is_as_far_from_the_gaze_as_it_says() {
        let (mapping, standpoint, rect) = case();
        for gaze in [Gaze::default(), Gaze { point: Vec2::new(0.6, -0.4) }] {
            for degrees in RINGS_DEG {
                let at_eye = ring(&mapping, &standpoint, rect, gaze, EccentricityAt::Eye, degrees);
                let in_scene = ring(&mapping, &standpoint, rect, gaze, EccentricityAt::Scene, degrees);
                let point = |at: Pos2| Vec2::new(2.0 * at.x / rect.width() - 1.0, 1.0 - 2.0 * at.y / rect.height());
                for at in at_eye.iter().flatten() {
                    let [from, to] = [gaze.point, point(*at)].map(|point| point * mapping.half_size_mm);
                    let found = mapping.screen.eccentricity(from, to).to_degrees();
                    assert!((found - degrees).abs() < 0.02, "{found} instead of {degrees} at the eye");
                }
                let view = standpoint.view;
                for at in in_scene.iter().flatten() {
                    let found = view.direction_at(gaze.point).angle_between(view.direction_at(point(*at))).to_degrees();
                    assert!((found - degrees).abs() < 0.02, "{found} instead of {degrees} in the scene");
                }
                assert!(at_eye.iter().flatten().count() > 60 && in_scene.iter().flatten().count() > 60, "{degrees}");
            }
        }
    }

    #[test]
    fn a_ring_begins_above_the_gaze_and_closes() {
        let (mapping, standpoint, rect) = case();
        for at in [EccentricityAt::Eye, EccentricityAt::Scene] {
            let points = ring(&mapping, &standpoint, rect, Gaze::default(), at, 5.0);
            let (first, last) = (points[0].unwrap_or_default(), points[points.len() - 1].unwrap_or_default());
            assert!(first.distance(last) < 0.1, "{first:?} {last:?}");
            assert!((first.x - rect.center().x).abs() < 0.1 && first.y < rect.center().y - 10.0, "{first:?}");
        }
    }
}
