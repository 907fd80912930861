//! What the preview's thread shows beside the picture, without a window: two modes with the same time, first hits in parts, and
//! the histogram.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::ffi::OsString;
use std::time::{Duration, Instant};

use egui::{Rect, pos2};
use fovea_app::cli::choices::Mode;
use fovea_app::cli::{self, PreviewArgs};
use fovea_app::preview::compare::Comparison;
use fovea_app::preview::controls::Controls;
use fovea_app::preview::engine::Look;
use fovea_app::preview::gaze::{Gaze, ScreenMapping};
use fovea_app::preview::navigation::Navigation;
use fovea_app::preview::tracing::Tracing;
use fovea_app::readback;
use fovea_app::session::{self, Source};
use glam::UVec2;
use tracer::distribution::View as TracerView;
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::renderer::Renderer;
use tracer::view::{DebugView, ToneMap, ViewProjection, ViewSettings};

const SIZE: [u32; 2] = [160, 90];

fn args() -> PreviewArgs {
    let line = "fovea --mode fv --seed 3 --max-bounces 1 --film-memory 16";
    cli::parse(line.split_whitespace().map(OsString::from)).unwrap().preview
}

/// The built-in scene in a window of 160x90 pixels.
fn open() -> (Tracing, Look) {
    let args = args();
    let scene = session::load(&Source::BuiltIn, &args.scene).unwrap().scene;
    let camera = &session::viewpoints(&scene)[0];
    let controls = Controls::from(&args);
    let rect = Rect::from_min_max(pos2(0.0, 0.0), pos2(SIZE[0] as f32, SIZE[1] as f32));
    let mapping = ScreenMapping::new(controls.screen, rect, None);
    let navigation = Navigation::new(camera.position, camera.rotation, camera.vfov, 160.0 / 90.0, 4.0);
    let size_px = UVec2::from(SIZE);
    let look =
        Look { standpoint: navigation.standpoint, gaze: Gaze::default(), controls, mapping, size_px, pointer: None };
    let mut tracing = Tracing::new(Gpu::headless(&AdapterSelect::Auto).unwrap(), args);
    tracing.set_scene(scene).unwrap();
    (tracing, look)
}

/// What a renderer's film looks like in the whole view.
fn whole(renderer: &mut Renderer, look: &Look) -> Vec<[u8; 4]> {
    let view = look.standpoint.view;
    let settings = ViewSettings {
        projection: ViewProjection::Perspective(TracerView {
            world_from_view: view.film_from_view(),
            half_extent: view.tan_half,
        }),
        size: SIZE,
        exposure_ev: look.controls.exposure_ev,
        tone_map: ToneMap::AgX,
        debug_view: look.controls.shown,
        fill: true,
        denoise: false,
        ring: None,
    };
    readback::draw(renderer, &settings).unwrap()
}

fn shown(tracing: &mut Tracing, look: &Look) -> Vec<[u8; 4]> {
    tracing.show(look, 1).unwrap();
    tracing.texels().unwrap().1
}

/// Traces for so long and returns the time of both films.
fn trace(tracing: &mut Tracing, time: Duration) -> [f64; 2] {
    let start = Instant::now();
    while start.elapsed() < time {
        tracing.trace(1 << 11).unwrap();
    }
    [tracing.elapsed(), tracing.seen().beside.unwrap().traced].map(|time| time.as_secs_f64())
}

#[test]
fn two_modes_get_the_same_time_and_each_its_side() {
    let (mut tracing, mut look) = open();
    tracing.follow(&look).unwrap();
    tracing.trace(1 << 14).unwrap();
    look.controls.comparison = Some(Comparison { mode: Mode::Vp, wipe: 0.25 });
    tracing.follow(&look).unwrap();
    assert_eq!((tracing.samples(), tracing.seen().beside.unwrap().samples), (0, 0), "both begin together");
    let [first, other] = trace(&mut tracing, Duration::from_secs(3));
    assert!(first > 0.5 && (first / other - 1.0).abs() < 0.1, "{first} s and {other} s");
    let beside = tracing.seen().beside.unwrap();
    assert!(beside.mode == Mode::Vp && tracing.samples() > 0 && beside.samples > 0, "{beside:?}");
    eprintln!("{first:.3} s for {} samples, {other:.3} s for {}", tracing.samples(), beside.samples);

    let (left, right) = (whole(tracing.renderer().unwrap(), &look), whole(tracing.renderer_beside().unwrap(), &look));
    let is_left = |index: usize| index as u32 % SIZE[0] < SIZE[0] / 4;
    let differing = |a: &[[u8; 4]], b: &[[u8; 4]]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    let mixed = |index: usize| if is_left(index) { left[index] } else { right[index] };
    let expected: Vec<_> = (0..left.len()).map(mixed).collect();
    assert!(differing(&left, &right) > 1000, "the modes look alike");
    assert!(shown(&mut tracing, &look) == expected, "left is the first film, right the other");
    look.controls.comparison = Some(Comparison { mode: Mode::Vp, wipe: 1.0 });
    tracing.follow(&look).unwrap();
    assert!(shown(&mut tracing, &look) == left, "the line at the right edge");

    // Another mode begins both anew, and its end leaves the first film.
    look.controls.comparison = Some(Comparison { mode: Mode::Od, wipe: 0.0 });
    tracing.follow(&look).unwrap();
    assert_eq!((tracing.samples(), tracing.seen().beside.unwrap().samples), (0, 0));
    trace(&mut tracing, Duration::from_millis(200));
    let right = whole(tracing.renderer_beside().unwrap(), &look);
    assert!(shown(&mut tracing, &look) == right, "the line at the left edge");
    let samples = tracing.samples();
    look.controls.comparison = None;
    tracing.follow(&look).unwrap();
    assert_eq!((tracing.samples(), tracing.seen().beside), (samples, None));
}

#[test]
fn a_trial_of_split_times_begins_without_a_picture_and_is_not_denoised() {
    let (mut tracing, mut look) = open();
    look.controls.denoise = true;
    tracing.follow(&look).unwrap();
    tracing.trace(1 << 14).unwrap();
    while tracing.is_guided(&look) == Some(false) {
        tracing.find_guides(&look).unwrap();
    }
    let lit = |texels: &[[u8; 4]]| texels.iter().filter(|texel| texel[..3] != [0; 3]).count();
    assert!(lit(&shown(&mut tracing, &look)) > 10_000);
    for trial in [4, 5] {
        look.controls.trial = Some(trial);
        tracing.follow(&look).unwrap();
        assert!(tracing.begin_trial(look.controls.trial) && !tracing.begin_trial(look.controls.trial));
        assert_eq!((tracing.samples(), tracing.elapsed()), (0, Duration::ZERO));
        assert_eq!((lit(&shown(&mut tracing, &look)), tracing.is_guided(&look)), (0, None), "trial {trial}");
        tracing.trace(1 << 12).unwrap();
        assert!(shown(&mut tracing, &look) == whole(tracing.renderer().unwrap(), &look), "its samples and no guides");
    }
    // What was seen last stays when the run is over.
    look.controls.trial = None;
    tracing.follow(&look).unwrap();
    assert!(!tracing.begin_trial(None) && tracing.samples() > 0 && tracing.is_guided(&look).is_some());
}

#[test]
fn both_films_follow_the_viewer_and_the_scene() {
    let (mut tracing, mut look) = open();
    look.controls.comparison = Some(Comparison { mode: Mode::Fv, wipe: 0.5 });
    tracing.follow(&look).unwrap();
    let check = |tracing: &mut Tracing, what: &str| {
        let (pose, film) = (tracing.renderer().unwrap().pose(), tracing.renderer().unwrap().options().film);
        let hash = tracing.renderer().unwrap().film_header().unwrap().scene;
        let beside = tracing.renderer_beside().unwrap();
        assert_eq!((beside.pose(), beside.options().film), (pose, film), "{what}");
        assert_eq!((beside.samples(), beside.film_header().unwrap().scene), (0, hash), "{what}");
        trace(tracing, Duration::from_millis(50));
    };
    check(&mut tracing, "at first");
    look.standpoint.position.x += 0.25;
    tracing.follow(&look).unwrap();
    check(&mut tracing, "moved");
    let scene = session::load(&Source::BuiltIn, &args().scene).unwrap().scene;
    let mut edited = (*scene).clone();
    edited.instances[0].visible = false;
    tracing.set_scene(edited.into()).unwrap();
    tracing.follow(&look).unwrap();
    check(&mut tracing, "edited");
    tracing.restart();
    check(&mut tracing, "restarted");
    // A closer view wants a finer film.
    look.standpoint.view.tan_half *= 0.05;
    tracing.follow(&look).unwrap();
    check(&mut tracing, "zoomed");
}

#[test]
fn first_hits_are_finished_by_pictures_that_are_due() {
    let (mut tracing, mut look) = open();
    tracing.follow(&look).unwrap();
    tracing.trace(1 << 12).unwrap();
    tracing.show(&look, 1).unwrap();
    assert!(!tracing.is_unfinished() && tracing.seen().scale.is_none());
    look.controls.shown = DebugView::Depth;
    let start = Instant::now();
    loop {
        tracing.show(&look, 1).unwrap();
        if !tracing.is_unfinished() {
            break;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "first hits do not end");
    }
    assert_eq!(tracing.renderer().unwrap().first_hits().unwrap().len() as u32, SIZE[0] * SIZE[1]);
    let scale = tracing.seen().scale.unwrap();
    // The room is some metres across.
    assert!(0.1 < scale.low && scale.low < scale.high && scale.high < 30.0, "{scale:?}");
    look.controls.shown = DebugView::Beauty;
    tracing.show(&look, 1).unwrap();
    assert!(!tracing.is_unfinished() && tracing.seen().scale.is_none());
}

/// Guides are found in parts between batches; from then on the picture is another, and without them it is what it was.
#[test]
fn a_resting_picture_is_denoised_once_its_first_hits_are_known() {
    let (mut tracing, mut look) = open();
    look.controls.denoise = true;
    tracing.follow(&look).unwrap();
    tracing.trace(1 << 12).unwrap();
    let shown = |tracing: &mut Tracing, look: &Look| {
        tracing.show(look, 1).unwrap();
        tracing.texels().unwrap().1
    };
    let until_guided = |tracing: &mut Tracing, look: &Look| {
        assert_eq!(tracing.is_guided(look), Some(false));
        let start = Instant::now();
        while tracing.is_guided(look) == Some(false) {
            tracing.find_guides(look).unwrap();
            assert!(start.elapsed() < Duration::from_secs(120), "guides do not end");
        }
    };
    let plain = shown(&mut tracing, &look);
    until_guided(&mut tracing, &look);
    let guided = shown(&mut tracing, &look);
    assert!(plain != guided && tracing.is_guided(&look) == Some(true));
    // Another view has other guides, and the first one's are found again.
    let aside = look.clone();
    look.standpoint.view.yaw += 0.3;
    tracing.follow(&look).unwrap();
    shown(&mut tracing, &look);
    until_guided(&mut tracing, &look);
    tracing.follow(&aside).unwrap();
    shown(&mut tracing, &aside);
    until_guided(&mut tracing, &aside);
    assert!(shown(&mut tracing, &aside) == guided);
    look = aside;
    look.controls.denoise = false;
    assert_eq!(tracing.is_guided(&look), None);
    assert!(shown(&mut tracing, &look) == plain);
}

#[test]
fn pixels_are_counted_while_somebody_looks_and_when_the_exposure_changes() {
    let (mut tracing, mut look) = open();
    tracing.follow(&look).unwrap();
    tracing.trace(1 << 14).unwrap();
    tracing.show(&look, 1).unwrap();
    assert_eq!(tracing.seen().histogram, None, "nobody looks");
    look.controls.histogram = true;
    tracing.show(&look, 1).unwrap();
    let plain = tracing.seen().histogram.unwrap();
    assert_eq!(plain.bins.iter().sum::<u32>(), SIZE[0] * SIZE[1]);
    look.controls.exposure_ev = 4.0;
    tracing.show(&look, 1).unwrap();
    let bright = tracing.seen().histogram.unwrap();
    assert!(bright.clipped > plain.clipped, "{} {}", bright.clipped, plain.clipped);
    // Four stops are sixteen bins.
    let inner = 24..60;
    assert!(inner.clone().filter(|bin| plain.bins[*bin] > 0).count() > 10);
    let moved: u32 = inner.map(|bin| plain.bins[bin].abs_diff(bright.bins[bin + 16])).sum();
    assert!(moved <= plain.pixels / 500, "{moved} pixels moved elsewhere");
}
