#![expect(clippy::unwrap_used, reason = "a test may panic")]

use super::*;

fn read(line: &str) -> Result<Cli, Stop> {
    parse(line.split(' ').map(OsString::from))
}

fn render(line: &str) -> RenderArgs {
    match read(&format!("fovea render {line}")).unwrap().command {
        Some(Command::Render(args)) => *args,
        other => panic!("{other:?}"),
    }
}

fn complaint(line: &str) -> String {
    match read(line) {
        Err(Stop::Wrong(message)) => message,
        other => panic!("{line}: {other:?}"),
    }
}

#[test]
fn the_command_line_is_consistent() {
    command().debug_assert();
}

#[test]
fn what_is_stated_of_a_film_is_told_from_defaults() {
    assert_eq!(render("-o a.exr --resume b.exr --gaze 1,2").stated, Vec::<&str>::new());
    let stated = render("-o a.exr --resume b.exr --seed 1 --max-bounces 8 --film equirect:2048x1024").stated;
    assert_eq!(stated, ["film", "seed", "max_bounces"]);
    assert!(complaint("fovea render -o a.exr --resume b.exr --first-sample 5").contains("--first-sample"));
    assert!(complaint("fovea render -o a.exr --tev localhost").contains("HOST:PORT"));
    assert!(complaint("fovea merge -o a.exr").contains("FILM.exr"));
}

#[test]
fn defaults_are_those_of_the_documentation() {
    let args = render("-o a.exr");
    assert_eq!(args.sampling.mode, Mode::Fv);
    assert_eq!(args.film, FilmShape::Equirect(SizePx { width: 2048, height: 1024 }));
    assert_eq!(args.gaze, GazeAngles { yaw_deg: 0.0, pitch_deg: 0.0 });
    assert_eq!((args.clip, args.eccentricity), (None, EccentricityAt::Scene));
    assert_eq!((args.sampling.max_bounces, args.sampling.seed, args.sampling.floor), (8, 1, None));
    let preview = read("fovea").unwrap().preview;
    assert_eq!((preview.clip, preview.eccentricity), (Clip::View, EccentricityAt::Eye));
}

#[test]
fn every_option_of_render_is_read() {
    let args = render(
        "scene.glb -o b.png --mode vp-region --film perspective:640x360 --camera Front --orient camera \
         --view -30,10,90x60 --gaze -12.5,-3 --clip view --eccentricity eye --samples 5000000000 --max-bounces 0 \
         --seed 4294967295 --sequence independent --env sky.hdr --env-rotate -90 --model reddy --geometry plane \
         --inverse eq6 --floor 0 --exposure -1.5 --tonemap pbr-neutral --json --dump-kernels out --adapter llvmpipe \
         --screen-mm 600x340 --distance-mm 700 --sun-angle 0.53 --gltf-scene 1 --time -0.5 --variant beach \
         --show noise --denoise off",
    );
    assert_eq!(args.scene.camera, Some(CameraChoice::Name("Front".into())));
    assert_eq!(args.view, Some(ViewAngles { yaw_deg: -30.0, pitch_deg: 10.0, hfov_deg: 90.0, vfov_deg: 60.0 }));
    assert_eq!(args.gaze, GazeAngles { yaw_deg: -12.5, pitch_deg: -3.0 });
    assert_eq!(args.stop.samples, Some(5_000_000_000));
    assert_eq!((args.scene.sun_angle, args.scene.file.gltf_scene, args.scene.file.time), (0.53, Some(1), Some(-0.5)));
    assert_eq!(args.scene.file.variant.as_deref(), Some("beach"));
    assert_eq!((args.picture.show, args.picture.denoise), (Show::Noise, Switch::Off));
    assert_eq!((args.scene.env_rotate, args.picture.exposure), (-90.0, -1.5));
    assert_eq!(args.sampling.screen_mm, Some(SizeMm { width: 600.0, height: 340.0 }));
    assert_eq!(render("-o a.exr --camera 2").scene.camera, Some(CameraChoice::Index(2)));
    assert_eq!(render("-o a.exr --background 1,0.5,0").scene.background, Some(Rgb([1.0, 0.5, 0.0])));
}

#[test]
fn wrong_values_are_refused_in_one_line_that_names_the_option_and_the_cause() {
    for (line, option, cause) in [
        ("fovea render -o a.exr --view 0,95,100x100", "--view", "pitch"),
        ("fovea render -o a.exr --view 0,0,0x100", "--view", "0.1..=170"),
        ("fovea render -o a.exr --view 0,0,100", "--view", "HFOVxVFOV"),
        ("fovea render -o a.exr --gaze nan,0", "--gaze", "out of range"),
        ("fovea render -o a.exr --gaze 1,2,3", "--gaze", "2 parts, not 3"),
        ("fovea render -o a.exr --film equirect:0x10", "--film", "1..=65536"),
        ("fovea render -o a.exr --film fisheye:10x10", "--film", "equirect or perspective"),
        ("fovea render -o a.exr --film equirect:99999999999x10", "--film", "99999999999"),
        ("fovea render -o a.exr --floor 1.5", "--floor", "0..=1"),
        ("fovea render -o a.exr --background 1,-1,1", "--background", "radiance"),
        ("fovea render -o a.exr --background inf,1,1", "--background", "radiance"),
        ("fovea render -o a.exr --exposure 1e9", "--exposure", "EV"),
        ("fovea render -o a.exr --seconds 0", "--seconds", "above 0"),
        ("fovea render -o a.exr --seconds nan", "--seconds", "above 0"),
        ("fovea render -o a.exr --spp 0", "--spp", "0 is not in"),
        ("fovea render -o a.exr --seed -1", "--seed", "-1 is not in"),
        ("fovea render -o a.exr --mode best", "--mode", "fv"),
        ("fovea render -o a.exr --sun-angle 181", "--sun-angle", "degrees"),
        ("fovea render -o a.exr --time nan", "--time", "out of range"),
        ("fovea render -o a.exr --distance-mm 0", "--distance-mm", "mm"),
        ("fovea render a.glb", "--output", "required"),
        ("fovea render -o a.exr --spp 1 --seconds 1", "--spp", "cannot be used"),
        ("fovea render -o a.exr --env a.hdr --background 1,1,1", "--env", "cannot be used"),
        ("fovea render -o a.exr --env-rotate 9 --background 1,1,1", "--env-rotate", "cannot be used"),
        ("fovea render -o a.exr --gaze 1,2 --gaze-trace a.csv", "--gaze", "cannot be used"),
        ("fovea render -o a.exr --gaze-trace a.csv --seconds 1", "--seconds", "cannot be used"),
        ("fovea --gaze moose", "--gaze", "mouse-dwell"),
        ("fovea --gaze-accuracy -1", "--gaze-accuracy", "0..=20"),
        ("fovea gaze", "--list", "required"),
        ("fovea gaze --list --source mouse", "--list", "cannot be used"),
        ("fovea gaze --list --record a.csv", "--list", "cannot be used"),
        ("fovea --no-such-thing", "--no-such-thing", "unexpected"),
    ] {
        let message = complaint(line);
        assert!(message.contains(option) && message.contains(cause), "{line}: {message}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn adaptive_sampling_can_be_switched_both_ways() {
    for (line, adaptive) in [
        ("-o a.exr", Switch::Off),
        ("--adaptive -o a.exr", Switch::On),
        ("--adaptive room.glb -o a.exr", Switch::On),
        ("--adaptive=on -o a.exr", Switch::On),
        ("--adaptive=off -o a.exr", Switch::Off),
    ] {
        assert_eq!(render(line).sampling.adaptive, adaptive, "{line}");
    }
    assert_eq!(read("fovea --adaptive=off").unwrap().preview.stated, ["adaptive"]);
}

#[test]
fn the_windows_help_says_what_it_keeps() {
    let help = |line: &str| match read(line) {
        Err(Stop::Asked(text)) => text.split_whitespace().collect::<Vec<_>>().join(" "),
        other => panic!("{other:?}"),
    };
    let (window, render) = (help("fovea --help"), help("fovea render --help"));
    for usual in ["fv", "off", "0", "agx", "on", "1280x720"] {
        assert!(window.contains(&format!("[default: as last left, else {usual}]")), "{usual}: {window}");
    }
    assert!(!window.contains("[default: fv]") && render.contains("[default: fv]"));
    assert!(!render.contains("as last left"));
}

#[test]
fn help_and_version_are_no_errors() {
    for line in ["fovea --help", "fovea --version", "fovea render --help"] {
        assert!(matches!(read(line), Err(Stop::Asked(text)) if text.contains("fovea")), "{line}");
    }
}
