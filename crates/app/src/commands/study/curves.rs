//! Renders the references and all runs of a scene; what is there already is not rendered again.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde_json::{Value, json};
use tracer::renderer::SequenceKind;
use tracer::scene::ContentHash;

use super::bench::{self, Bench, Picture};
use super::error::{Film, Reference, Regions, Rgb, by_region, luminance};
use super::picture::{self, Crop, Fovea};
use super::plan::{Method, Place};
use super::record::{self, Row, RunKey};
use super::report;
use crate::cli::study::{Part, StudyArgs};
use crate::output::{write_atomically, write_text};

/// Seeds of the references: no run has them.
const REFERENCE_SEEDS: [u32; 2] = [0x5eed_0001, 0x5eed_0002];

/// Pixels across and up of the view's picture: as fine in its middle as the film.
pub fn view_side(film_width: u32) -> u32 {
    (film_width * 3).div_ceil(8).max(16)
}

/// A place with what its pictures are compared with.
struct Judge {
    place: Place,
    film_regions: Regions,
    view_regions: Regions,
    view: Reference,
    crop: Crop,
    fovea: Fovea,
}

/// What the runs of a scene are compared with.
pub struct References {
    film: Reference,
    judges: Vec<Judge>,
    side: u32,
}

/// Floats of one reference: the film's means, then each place's view; and the views' texels.
struct Stored {
    film: Vec<Rgb>,
    views: Vec<Picture>,
}

impl References {
    /// Reads or renders both references.
    ///
    /// # Errors
    /// When the device is lost or a file cannot be written.
    pub fn new(bench: &mut Bench, args: &StudyArgs) -> anyhow::Result<Self> {
        let side = view_side(bench.film.width);
        let mut stored = Vec::new();
        for (number, seed) in REFERENCE_SEEDS.into_iter().enumerate() {
            let path = path(&args.output, &bench.name, number);
            stored.push(match load(&path, bench, side)? {
                Some(found) => found,
                None => {
                    let made = render(bench, args, side, seed)?;
                    save(&path, &made)?;
                    made
                }
            });
        }
        let [Some(second), Some(first)] = [stored.pop(), stored.pop()] else {
            bail!("two references are needed");
        };
        let mean_luminance = first.film.iter().chain(&second.film).map(|rgb| luminance(*rgb)).sum::<f64>()
            / (2 * first.film.len()).max(1) as f64;
        let views = first.views.into_iter().zip(second.views);
        let judges = bench.places.iter().zip(views).map(|(place, (a, b))| {
            let view_regions = Regions::of_view(side, place);
            let encoded = picture::mean(&a.encoded, &b.encoded);
            Judge {
                film_regions: Regions::of_film(&bench.film, place),
                view: Reference::new([a.linear, b.linear], side as usize, mean_luminance),
                crop: Crop::middle(&encoded, side as usize),
                fovea: Fovea::new(&view_regions, side as usize),
                view_regions,
                place: place.clone(),
            }
        });
        let judges = judges.collect();
        let film = Reference::new([first.film, second.film], bench.film.width as usize, mean_luminance);
        Ok(Self { film, judges, side })
    }
}

impl Judge {
    fn row(&self, samples: u64, film: &Film, of_film: &Reference, view: &Picture, side: u32) -> Row {
        let measured = film.measure(of_film, &self.film_regions);
        let errors = by_region(&self.view_regions, |pixel| {
            Some(self.view.relative_square(pixel, view.linear[pixel].map(f64::from)))
        });
        let picture = Crop::middle(&view.encoded, side as usize).measure(&self.crop, &self.fovea);
        Row::new(samples, &measured, &errors, &picture)
    }
}

fn path(folder: &Path, scene: &str, number: usize) -> PathBuf {
    folder.join("references").join(format!("{scene}-{}.bin", number + 1))
}

fn render(bench: &mut Bench, args: &StudyArgs, side: u32, seed: u32) -> anyhow::Result<Stored> {
    let places = bench.places.clone();
    let first = places.first().context("a scene needs a gaze")?;
    bench.begin(Method::Od, first, seed, SequenceKind::Sobol)?;
    bench.go_on(args.reference_spp * bench.film.pixels())?;
    let views = places.iter().map(|place| bench.view(place, side)).collect::<anyhow::Result<_>>()?;
    Ok(Stored { film: bench.film()?.means(), views })
}

fn save(path: &Path, stored: &Stored) -> anyhow::Result<()> {
    use std::io::Write;
    let views = stored.views.iter();
    let floats: Vec<Rgb> = stored.film.iter().chain(views.clone().flat_map(|view| &view.linear)).copied().collect();
    let texels: Vec<[u8; 3]> = views.flat_map(|view| &view.encoded).copied().collect();
    Ok(write_atomically(path, |writer| {
        let written = writer.write_all(bytemuck::cast_slice(&floats));
        written.and_then(|()| writer.write_all(bytemuck::cast_slice(&texels))).map_err(|error| error.to_string())
    })?)
}

/// A reference of these settings; `None` when there is none.
fn load(path: &Path, bench: &Bench, side: u32) -> anyhow::Result<Option<Stored>> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error).with_context(|| path.display().to_string()),
    };
    let (film, view, places) = (bench.film.pixels() as usize, (side * side) as usize, bench.places.len());
    let floats = (film + view * places) * size_of::<Rgb>();
    if bytes.len() != floats + view * places * 3 {
        bail!("{}: of another size than this study's; remove it or take another folder", path.display());
    }
    let (floats, texels) = bytes.split_at(floats);
    let colours: Vec<Rgb> = bytemuck::pod_collect_to_vec(floats);
    let (film, linear) = colours.split_at(film);
    let texels: &[[u8; 3]] = bytemuck::cast_slice(texels);
    let views = linear.chunks_exact(view).zip(texels.chunks_exact(view));
    let views = views.map(|(linear, encoded)| Picture { linear: linear.to_vec(), encoded: encoded.to_vec() });
    Ok(Some(Stored { film: film.to_vec(), views: views.collect() }))
}

/// A render that fills one or, where it does not depend on the gaze, several runs.
struct Job {
    method: Method,
    seed: u32,
    /// Places whose runs it fills.
    places: Vec<usize>,
}

/// What is left to be rendered: seeds outermost, so that an interrupted study has whole repetitions, and Eq. 6, which needs a
/// kernel of its own, together at the end of each.
fn jobs(bench: &Bench, args: &StudyArgs) -> Vec<Job> {
    let missing = |method, place: &Place, seed| {
        let key = RunKey { scene: bench.name.clone(), gaze: place.name(), method, seed };
        !key.path(&args.output).exists()
    };
    let every = 0..bench.places.len();
    let mut jobs = Vec::new();
    for seed in 1..=args.seeds {
        let left = |method| -> Vec<usize> {
            every.clone().filter(|place| missing(method, &bench.places[*place], seed)).collect()
        };
        let once = left(Method::Od);
        if !once.is_empty() {
            jobs.push(Job { method: Method::Od, seed, places: once });
        }
        let methods = Method::ALL.into_iter().filter(|method| !matches!(method, Method::Od | Method::FvEq6));
        for method in methods.chain([Method::FvEq6]) {
            let wanted = |place: &usize| method != Method::FvWander || args.gaze_trace.is_some() && *place == 0;
            let places = left(method).into_iter().filter(wanted);
            jobs.extend(places.map(|place| Job { method, seed, places: vec![place] }));
        }
    }
    jobs
}

/// What decides a scene's curves, beside what names a run.
fn settings(bench: &Bench, args: &StudyArgs) -> Value {
    let pose = bench.pose();
    json!({
        "scene": bench.scene.name,
        "scene_hash": bench.scene.content_hash().to_string(),
        "position_m": pose.position.to_array(),
        "world_from_film_xyzw": pose.world_from_film.to_array(),
        "film": [bench.film.width, bench.film.height],
        "max_bounces": args.max_bounces,
        "spp": args.spp,
        "reference_spp": args.reference_spp,
        "gazes": bench.places.iter().map(Place::name).collect::<Vec<_>>(),
    })
}

/// Name of the setting that only the curve along a recording depends on: that may be added to a study, or left out, later.
const TRACE: &str = "gaze_trace";

/// Makes sure that a folder holds no curves of other settings of a scene, and says what its settings are.
fn claim(bench: &Bench, args: &StudyArgs) -> anyhow::Result<()> {
    let path = args.output.join("references").join(format!("{}.json", bench.name));
    let mut wanted = settings(bench, args);
    let found = std::fs::read_to_string(&path).ok();
    // What is no JSON is no study of these settings either.
    let known = found.map(|text| serde_json::from_str(&text).unwrap_or(Value::Null));
    let known_trace = known.as_ref().map_or(Value::Null, |known: &Value| known[TRACE].clone());
    let trace = match &args.gaze_trace {
        Some(path) => {
            let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
            ContentHash::of(&[&bytes]).to_string().into()
        }
        None => known_trace.clone(),
    };
    let is_same_trace = known_trace.is_null() || known_trace == trace;
    if !trace.is_null() {
        wanted[TRACE] = trace;
    }
    match known {
        Some(known) if known == wanted => return Ok(()),
        Some(mut known) => {
            if let Some(known) = known.as_object_mut() {
                known.insert(TRACE.into(), wanted[TRACE].clone());
            }
            if !is_same_trace || known != wanted {
                bail!("{}: the folder holds a study with other settings; take another --out", path.display());
            }
        }
        None => {}
    }
    Ok(write_text(&path, &format!("{wanted:#}\n"))?)
}

/// Renders what is missing of a scene's runs. `progress` hears the fraction that is done.
///
/// # Errors
/// When the device is lost or a file cannot be written.
pub fn render_missing(bench: &mut Bench, args: &StudyArgs, progress: &dyn Fn(f64)) -> anyhow::Result<()> {
    claim(bench, args)?;
    let jobs = jobs(bench, args);
    if jobs.is_empty() {
        return Ok(());
    }
    let pixels = bench.film.pixels();
    let cost =
        |job: &Job| job.method.schedule(pixels, args.spp, job.places[0] == 0).last().copied().unwrap_or(0) as f64;
    let reference_cost = 2.0 * (args.reference_spp * pixels) as f64;
    let whole = reference_cost + jobs.iter().map(cost).sum::<f64>();
    report::write_provenance(args, bench.gpu(), Part::Curves)?;
    let references = References::new(bench, args)?;
    let mut done = reference_cost;
    for job in &jobs {
        progress(done / whole);
        run(bench, args, &references, job)?;
        done += cost(job);
    }
    Ok(())
}

fn run(bench: &mut Bench, args: &StudyArgs, references: &References, job: &Job) -> anyhow::Result<()> {
    let schedule = job.method.schedule(bench.film.pixels(), args.spp, job.places[0] == 0);
    let about = &references.judges[job.places[0]].place;
    let steps = match &args.gaze_trace {
        Some(path) if job.method == Method::FvWander => {
            bench::recorded(path, about, schedule.last().copied().unwrap_or(0))?
        }
        _ => Vec::new(),
    };
    bench.begin(job.method, about, job.seed, job.method.sequence())?;
    let mut rows = vec![Vec::new(); job.places.len()];
    for samples in schedule {
        if steps.is_empty() {
            bench.go_on(samples)?;
        } else {
            bench.follow(&steps, about, samples)?;
        }
        let film = bench.film()?;
        for (rows, place) in rows.iter_mut().zip(&job.places) {
            let judge = &references.judges[*place];
            let view = bench.view(&judge.place, references.side)?;
            rows.push(judge.row(samples, &film, &references.film, &view, references.side));
        }
    }
    for (rows, place) in rows.iter().zip(&job.places) {
        let gaze = references.judges[*place].place.name();
        let key = RunKey { scene: bench.name.clone(), gaze, method: job.method, seed: job.seed };
        record::write(&args.output, &key, rows)?;
    }
    Ok(())
}
