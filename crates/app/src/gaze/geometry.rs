//! From a fraction of a screen to an angle at the eye, to a point of the picture, to a direction in the scene.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use glam::{Vec2, Vec3};

use super::sample::Point;
use super::source::TrackedScreen;
use crate::screen::ScreenGeometry;
use crate::view::{self, View};

/// A rectangle of the desktop, physical pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectPx {
    /// Top left corner.
    pub origin: [f64; 2],
    /// Width and height, above 0.
    pub size: [f64; 2],
}

impl RectPx {
    /// The point in the middle.
    pub fn centre(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.origin[axis] + 0.5 * self.size[axis])
    }
}

/// Where the picture is on which screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowPlace {
    /// The screen that the window is on.
    pub monitor: RectPx,
    /// The picture, on the desktop.
    pub picture: RectPx,
    /// Millimetres of that screen and the distance to it.
    pub screen: ScreenGeometry,
    /// Whether the system told where the window is; Wayland does not.
    pub position_known: bool,
}

impl Default for WindowPlace {
    /// A full HD screen that the picture fills.
    fn default() -> Self {
        let whole = RectPx { origin: [0.0; 2], size: [1920.0, 1080.0] };
        Self { monitor: whole, picture: whole, screen: ScreenGeometry::default(), position_known: false }
    }
}

impl WindowPlace {
    /// Degrees at the eye from the screen's centre, + to the right and + up, of a fraction of the tracked screen (the
    /// window's screen unless the tracker names another).
    pub fn deg_from_screen(&self, point: [f64; 2], tracked: Option<TrackedScreen>) -> [f64; 2] {
        let (origin, size) =
            tracked.map_or((self.monitor.origin, self.monitor.size), |screen| (screen.origin_px, screen.size_px));
        self.deg_from_desktop([0, 1].map(|axis| origin[axis] + point[axis] * size[axis]))
    }

    /// The same for a point of the picture: +-1 at its edges, y up.
    pub fn deg_from_picture(&self, point: [f64; 2]) -> [f64; 2] {
        self.deg_from_desktop(self.desktop_from_picture(point))
    }

    /// The fraction of the window's screen at a point of the picture.
    pub fn screen_from_picture(&self, point: [f64; 2]) -> [f64; 2] {
        let px = self.desktop_from_picture(point);
        [0, 1].map(|axis| (px[axis] - self.monitor.origin[axis]) / self.monitor.size[axis])
    }

    fn desktop_from_picture(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let centre = self.picture.centre();
        [centre[0] + 0.5 * x * self.picture.size[0], centre[1] - 0.5 * y * self.picture.size[1]]
    }

    fn deg_from_desktop(&self, px: [f64; 2]) -> [f64; 2] {
        let centre = self.monitor.centre();
        let mm =
            [0, 1].map(|axis| (px[axis] - centre[axis]) * self.mm_per_px()[axis] / f64::from(self.screen.distance_mm));
        [mm[0].atan().to_degrees(), (-mm[1]).atan().to_degrees()]
    }

    /// The point of the picture at degrees from the screen's centre; beyond +-1 outside it.
    pub fn picture_from_deg(&self, deg: [f64; 2]) -> [f64; 2] {
        // The tangent grows without bound towards 90 degrees, where no screen is.
        let tangents =
            deg.map(|angle| angle.clamp(-85.0, 85.0).to_radians().tan() * f64::from(self.screen.distance_mm));
        let (monitor, picture) = (self.monitor.centre(), self.picture.centre());
        let px = [tangents[0] / self.mm_per_px()[0], -tangents[1] / self.mm_per_px()[1]];
        let from_centre = [0, 1].map(|axis| monitor[axis] + px[axis] - picture[axis]);
        [2.0 * from_centre[0] / self.picture.size[0], -2.0 * from_centre[1] / self.picture.size[1]]
    }

    fn mm_per_px(&self) -> [f64; 2] {
        [
            f64::from(self.screen.width_mm) / self.monitor.size[0],
            f64::from(self.screen.height_mm) / self.monitor.size[1],
        ]
    }

    /// Degrees of a sample's point in which it is filtered: at the eye from the screen's centre, or from the view's.
    pub fn deg(&self, point: Point, tracked: Option<TrackedScreen>) -> [f64; 2] {
        match point {
            Point::Screen01(point) => self.deg_from_screen(point, tracked),
            Point::ViewDeg(deg) => deg,
            Point::Picture(point) => self.deg_from_picture(point),
        }
    }

    /// The direction in film space of filtered degrees, of the kind that `like` is, through a view.
    pub fn direction(&self, deg: [f64; 2], like: Point, view: &View) -> Vec3 {
        match like {
            Point::ViewDeg(_) => {
                let [yaw, pitch] = deg.map(|angle| angle.to_radians() as f32);
                view.film_from_view() * view::direction(yaw, pitch)
            }
            Point::Screen01(_) | Point::Picture(_) => {
                let [x, y] = self.picture_from_deg(deg).map(|value| value as f32);
                view.direction_at(Vec2::new(x, y))
            }
        }
    }
}

/// Angle at the eye between two points given in degrees from the screen's centre, degrees.
pub fn angle_between_deg(a: [f64; 2], b: [f64; 2]) -> f64 {
    let ray = |deg: [f64; 2]| glam::DVec3::new(deg[0].to_radians().tan(), deg[1].to_radians().tan(), -1.0);
    ray(a).angle_between(ray(b)).to_degrees()
}

/// How long views are remembered: longer than any sample takes.
const MEMORY: Duration = Duration::from_secs(2);

/// Which view was shown when.
#[derive(Clone, Debug, Default)]
pub struct ViewHistory {
    views: VecDeque<(Instant, View)>,
}

impl ViewHistory {
    /// Says what is shown from now on.
    pub fn push(&mut self, at: Instant, view: View) {
        if self.views.back().is_none_or(|(_, last)| *last != view) {
            self.views.push_back((at, view));
        }
        // The view before the oldest sample is still needed: it was shown until the next one.
        while self.views.len() > 1 && at.saturating_duration_since(self.views[1].0) > MEMORY {
            self.views.pop_front();
        }
    }

    /// What was shown at a time; the oldest view that is known when that lies farther back.
    pub fn at(&self, time: Instant) -> Option<&View> {
        let shown = self.views.iter().rev().find(|(from, _)| *from <= time);
        shown.or(self.views.front()).map(|(_, view)| view)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    /// A window of 1280 x 720 on the right one of two monitors.
    fn place() -> WindowPlace {
        WindowPlace {
            monitor: RectPx { origin: [1920.0, 0.0], size: [2560.0, 1440.0] },
            picture: RectPx { origin: [2000.0, 100.0], size: [1280.0, 720.0] },
            screen: ScreenGeometry { width_mm: 597.0, height_mm: 336.0, distance_mm: 600.0 },
            position_known: true,
        }
    }

    #[test]
    fn a_fraction_of_the_screen_becomes_an_angle_at_the_eye() {
        let place = place();
        assert_eq!(place.deg_from_screen([0.5, 0.5], None), [0.0, 0.0]);
        let right_edge = place.deg_from_screen([1.0, 0.5], None)[0];
        assert!((right_edge - (298.5_f64 / 600.0).atan().to_degrees()).abs() < 1e-9);
        assert!(place.deg_from_screen([0.5, 0.0], None)[1] > 15.0, "up is positive");
        // A tracker that looks at the left monitor: its right edge is this one's left edge.
        let left = TrackedScreen { origin_px: [0.0, 0.0], size_px: [1920.0, 1080.0] };
        assert!((place.deg_from_screen([1.0, 0.5], Some(left))[0] + right_edge).abs() < 1e-9);
    }

    #[test]
    fn a_fraction_of_the_screen_becomes_a_point_of_the_picture_wherever_the_window_is() {
        let place = place();
        for (px, expected) in
            [([2000.0, 100.0], [-1.0, 1.0]), ([2640.0, 460.0], [0.0, 0.0]), ([3280.0, 820.0], [1.0, -1.0])]
        {
            let fraction = [(px[0] - 1920.0) / 2560.0, px[1] / 1440.0];
            let found = place.picture_from_deg(place.deg_from_screen(fraction, None));
            assert!((0..2).all(|axis| (found[axis] - expected[axis]).abs() < 1e-9), "{px:?}: {found:?}");
            let round_trip = place.picture_from_deg(place.deg_from_picture(expected));
            assert!((0..2).all(|axis| (round_trip[axis] - expected[axis]).abs() < 1e-9), "{round_trip:?}");
        }
    }

    #[test]
    fn directions_go_through_the_view_that_was_shown() {
        let start = Instant::now();
        let ms = Duration::from_millis;
        let view = |yaw_deg: f32| View::new(yaw_deg.to_radians(), 0.0, 1.2, 0.8);
        let mut history = ViewHistory::default();
        assert_eq!(history.at(start), None);
        for step in 0..100_u32 {
            history.push(start + ms(100) * step, view(step as f32));
        }
        let at = |time| history.at(time).unwrap().yaw.to_degrees();
        assert!((at(start + ms(9_950)) - 99.0).abs() < 1e-3 && (at(start + ms(9_850)) - 98.0).abs() < 1e-3);
        assert!((at(start) - 78.0).abs() <= 1.0, "older views are forgotten: {}", at(start));
        assert!(history.views.len() < 30);
        // The centre of the picture through a view turned to the right by 30 degrees.
        let place = place();
        let direction = place.direction(place.deg_from_picture([0.0, 0.0]), Point::Picture([0.0, 0.0]), &view(30.0));
        assert!(direction.distance(view::direction(30_f32.to_radians(), 0.0)) < 1e-5);
        let degrees = place.direction([10.0, 5.0], Point::ViewDeg([0.0; 2]), &view(30.0));
        assert!(degrees.distance(view::direction(40_f32.to_radians(), 5_f32.to_radians())) < 0.01);
    }

    #[test]
    fn angles_are_those_between_the_rays() {
        assert!((angle_between_deg([0.0, 0.0], [10.0, 0.0]) - 10.0).abs() < 1e-9);
        assert!((angle_between_deg([-10.0, 0.0], [10.0, 0.0]) - 20.0).abs() < 1e-9);
        assert!(angle_between_deg([20.0, 20.0], [20.0, 21.0]) < 1.0);
    }
}
