//! glTF 2.0 import: a `.glb` or `.gltf` file becomes an immutable [`Scene`] and a report of what was met.
//!
//! # What becomes of what
//! - Every (node, primitive) with triangles is one [`Instance`](crate::scene::Instance); primitives that share their data share one [`Mesh`],
//!   also across glTF meshes. Materials and textures that the chosen scene does not use are not loaded.
//! - Node transforms are composed in f64. When the scene's centre is farther from the file's origin than
//!   [`REBASE_RATIO`] times its diagonal, that centre becomes [`Scene::origin_in_file`] and all is stored relative to it;
//!   otherwise coordinates stay the file's.
//! - Winding is glTF's: front faces are counter-clockwise seen from outside, clockwise where `world_from_mesh` has a
//!   negative determinant. Triangles are stored as in the file; the renderer takes geometric normals to the world as it
//!   does vertex normals, so that the front stays in front.
//! - Skins and morph targets are baked at the file's own pose or at [`ImportOptions::time_secs`].
//! - Missing normals become flat ones; missing tangents are made by MikkTSpace where a material needs them.
//! - A missing or undecodable image becomes one neutral texel (black for emission, flat for normals, else white).
//! - Lights fall off by the inverse square alone: their `range`, a hint for rasterisers, is not used.
//! - Solids are as thick as their mesh: of `thicknessTexture` nothing is used. Neither is `occlusionTexture`, which nearly every file has:
//!   paths find the shade that it stands for.
//! - Images have 8 bits a channel; those of 16 are rounded.
//! - Orthographic cameras keep their projection in the scene, but films and views are in perspective.
//! - What reaches beyond [`LARGEST_COORDINATE`](crate::bvh::LARGEST_COORDINATE) is left out, triangle by triangle or node by node.
//! - Without any light, a neutral sky lights the scene and the report says so.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use crate::scene::{Material, Mesh, Scene};

mod accessor;
mod assemble;
mod container;
mod document;
mod error;
mod graph;
mod json;
mod material;
mod meshopt;
mod pose;
mod primitive;
mod report;
mod skin;
mod tangent;
mod texture;

pub use assemble::REBASE_RATIO;
pub use error::{ContentError, ImportError};
pub use report::{ImportReport, ImportSeconds, ImportWarning, SceneNode};

use accessor::Data;
use container::{Container, Folder};
use document::{Document, SUPPORTED_EXTENSIONS};
use error::Fault;
use texture::TextureTable;

/// What to take from a file. The default is the file's default scene in its own pose and materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Index of the scene; `None`: the file's default, else its first.
    pub scene: Option<usize>,
    /// Time at which the animations are sampled, seconds from their start; `None`: the pose that the nodes state.
    pub time_secs: Option<f32>,
    /// Name of a material variant (KHR_materials_variants); `None`: the materials that the primitives state.
    pub variant: Option<String>,
}

/// Imports a `.glb` or `.gltf` file with its companions.
///
/// # Errors
/// [`ImportError`] when the file cannot be read, is no glTF 2.0, needs an unsupported extension, or is inconsistent in a
/// way that leaves nothing sensible to show. Lesser trouble is in the report's warnings.
pub fn load_gltf(path: &Path, options: &ImportOptions) -> Result<(Scene, ImportReport), ImportError> {
    load_gltf_showing(path, options, |_| ())
}

/// As [`load_gltf`], and calls `shapes` with what the scene is before images are decoded and tangents made, which take most of
/// the time: all is there and in its place, but meshes lack tangents and grey or neutral texels stand for the images. Fit for
/// [`Renderer::sketch`](crate::renderer::Renderer::sketch). The import goes on when `shapes` returns; all cores are free until then.
///
/// # Errors
/// As [`load_gltf`], also after `shapes` was called.
pub fn load_gltf_showing(
    path: &Path,
    options: &ImportOptions,
    shapes: impl FnOnce(&Scene),
) -> Result<(Scene, ImportReport), ImportError> {
    let start = Instant::now();
    let bytes = std::fs::read(path).map_err(|source| ImportError::Read { file: path.to_owned(), source })?;
    let folder = Folder { path: Some(path.parent().unwrap_or(Path::new("")).to_owned()) };
    let name = path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
    let (scene, mut report) = import(&name, path, &folder, &bytes, options, (start, shapes))?;
    report.files.insert(0, path.to_owned());
    Ok((scene, report))
}

/// Imports a `.glb` (or self-contained `.gltf`) from memory; `name` is the scene's name and stands for the file in errors.
///
/// # Errors
/// As [`load_gltf`].
pub fn load_glb_bytes(name: &str, bytes: &[u8], options: &ImportOptions) -> Result<(Scene, ImportReport), ImportError> {
    import(name, Path::new(name), &Folder { path: None }, bytes, options, (Instant::now(), |_: &Scene| ()))
}

fn import(
    name: &str,
    file: &Path,
    folder: &Folder,
    bytes: &[u8],
    options: &ImportOptions,
    watch: (Instant, impl FnOnce(&Scene)),
) -> Result<(Scene, ImportReport), ImportError> {
    let container = Container::parse(file, bytes)?;
    import_document(name, folder, &container, options, watch).map_err(|fault| fault.in_file(file))
}

fn supported(extension: &str) -> bool {
    SUPPORTED_EXTENSIONS.contains(&extension)
}

fn import_document(
    name: &str,
    folder: &Folder,
    container: &Container<'_>,
    options: &ImportOptions,
    (start, shapes): (Instant, impl FnOnce(&Scene)),
) -> Result<(Scene, ImportReport), Fault> {
    let document = Document::parse(&container.json, supported)?;
    let mut report = new_report(&document);
    let (scene, roots) = choose_scene(&document, options)?;
    report.scene = scene;
    let variant = choose_variant(&document, options)?;
    let data = Data::load(&document, folder, container.bin, &mut report.files)?;
    report.animation_secs = pose::duration_secs(&data)?;
    report.stage_seconds.read = start.elapsed().as_secs_f64();

    let mut table = TextureTable::default();
    let mut materials: BTreeMap<usize, Material> = BTreeMap::new();
    let walk = graph::Walk { data: &data, roots, time_secs: options.time_secs, variant };
    let graph = walk.run(
        |index, warnings| {
            let material = match materials.entry(index) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => entry.insert(material::parse(&document, index, &mut table, warnings)?),
            };
            Ok(material::tangent_uv_set(material))
        },
        &mut report.warnings,
    )?;

    let (built, geometry_secs) =
        timed(|| graph.requests.par_iter().map(|r| primitive::build(&data, r)).collect::<Result<Vec<_>, _>>());
    report.stage_seconds.geometry = geometry_secs;
    let parts = assemble::Parts { name, graph, built: built?, materials, textures: table.stand_ins() };
    let (mut scene, tangents_along) = parts.assemble(&document, &mut report)?;
    shapes(&scene);

    let bare = std::mem::take(&mut scene.meshes);
    let ((meshes, tangent_secs), (textures, texture_secs)) =
        rayon::join(|| timed(|| with_tangents(bare, &tangents_along)), || timed(|| table.decode(&data, folder)));
    report.stage_seconds.tangents = tangent_secs;
    report.stage_seconds.textures = texture_secs;
    let decoded = textures?;
    (scene.meshes, scene.textures) = (meshes, decoded.textures);
    report.files.extend(decoded.files);
    report.warnings.extend(decoded.warnings);
    report.stage_seconds.total = start.elapsed().as_secs_f64();
    Ok((scene, report))
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

fn new_report(document: &Document<'_>) -> ImportReport {
    let extensions_unsupported = document.unsupported_extensions(supported);
    let ignored = extensions_unsupported.iter().map(|name| ImportWarning::ExtensionIgnored { name: name.clone() });
    ImportReport {
        warnings: ignored.collect(),
        extensions_used: document.extensions_used.clone(),
        generator: document.generator.clone(),
        variants: document.variants.clone(),
        scenes: document.scenes.iter().map(|s| s.name.clone()).collect(),
        extensions_unsupported,
        ..ImportReport::default()
    }
}

/// The scene's index and root nodes. A file without scenes shows all its root nodes.
fn choose_scene(document: &Document<'_>, options: &ImportOptions) -> Result<(usize, Vec<usize>), Fault> {
    let count = document.scenes.len();
    match options.scene {
        Some(index) if index >= count.max(1) => Err(Fault::new("scenes", ContentError::UnknownScene { index, count })),
        _ if count == 0 => {
            let mut is_child = vec![false; document.nodes.len()];
            document.nodes.iter().flat_map(|n| &n.children).for_each(|&child| is_child[child] = true);
            Ok((0, (0..document.nodes.len()).filter(|&n| !is_child[n]).collect()))
        }
        asked => {
            let index = asked.or(document.default_scene).unwrap_or(0);
            Ok((index, document.scenes[index].nodes.clone()))
        }
    }
}

fn choose_variant(document: &Document<'_>, options: &ImportOptions) -> Result<Option<usize>, Fault> {
    let Some(asked) = &options.variant else { return Ok(None) };
    document.variants.iter().position(|v| v == asked).map(Some).ok_or_else(|| {
        let cause = ContentError::UnknownVariant { asked: asked.clone(), known: document.variants.clone() };
        Fault::new("KHR_materials_variants", cause)
    })
}

/// Meshes with the tangents that some of them lack.
fn with_tangents(meshes: Vec<Arc<Mesh>>, along: &[Option<usize>]) -> Vec<Arc<Mesh>> {
    let made = meshes.into_par_iter().zip(along).with_max_len(1).map(|(mesh, along)| match along {
        Some(uv_set) => Arc::new(primitive::with_tangents(Arc::unwrap_or_clone(mesh), *uv_set)),
        None => mesh,
    });
    made.collect()
}

/// The hashes of meshes, computed in parallel.
fn hash_meshes(meshes: Vec<Mesh>) -> Vec<Arc<Mesh>> {
    let hashed = meshes.into_par_iter().map(|mut mesh| {
        mesh.hash = primitive::hash(&mesh);
        Arc::new(mesh)
    });
    hashed.collect()
}
