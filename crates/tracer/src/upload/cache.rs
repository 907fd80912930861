//! What stays on the device from one version of a scene to the next: an edit uploads only what it changes.

use std::{
    collections::{BTreeSet, HashMap},
    sync::Arc,
};

use glam::Affine3A;

use super::{
    UploadError, Uploader,
    albedo::{self, TABLE_FEATURES},
    environment::EnvironmentOnGpu,
    geometry::{BlasCache, Shapes, Split},
    tables::{Edit, Tables},
    texels::TexelHeap,
};
use crate::{
    bvh::HierarchyKind,
    features::SceneFeatures,
    scene::{ContentHash, Environment, Scene},
};

/// Instances that are moved or hidden at once and then kept apart; a change of more builds the static mesh anew.
const MOST_MOVED: usize = 16;
/// Instances that are kept apart in all; beyond, traversal would suffer, and they join the static mesh again.
const MOST_LOOSE: usize = 64;

/// An instance as the last version of the scene had it.
#[derive(Debug, PartialEq)]
struct Seen {
    mesh: ContentHash,
    world_from_mesh: Affine3A,
    visible: bool,
}

/// Parts of the last scene version on the device, by content, and hierarchies.
#[derive(Debug, Default)]
pub struct SceneCache {
    hierarchy: HierarchyKind,
    blas: BlasCache,
    /// Without nodes and positions, which nothing on the host needs any more; and where they are on the device.
    shapes: Option<(Arc<Shapes>, Tables)>,
    texels: Option<(ContentHash, Arc<TexelHeap>)>,
    environment: Option<(Option<ContentHash>, Arc<EnvironmentOnGpu>)>,
    lobe_tables: Option<([bool; 3], wgpu::TextureView, u64)>,
    tables: HashMap<&'static str, (ContentHash, wgpu::Buffer)>,
    seen: Vec<Seen>,
    /// Instances that were moved or hidden: they have a hierarchy of their own, so that the next move costs little.
    loose: BTreeSet<u32>,
}

impl SceneCache {
    /// Nothing yet; hierarchies will be of this kind.
    pub fn new(hierarchy: HierarchyKind) -> Self {
        Self { hierarchy, ..Self::default() }
    }

    /// Keeps the hierarchies alone: what is on the device is not, or will not become, what is known of it here.
    pub(crate) fn forget_device(&mut self) {
        *self = Self { hierarchy: self.hierarchy, blas: std::mem::take(&mut self.blas), ..Self::default() };
    }

    /// What its hierarchies are.
    pub fn hierarchy(&self) -> HierarchyKind {
        self.hierarchy
    }

    /// Which instances join the static mesh; instances that differ from the last version do not.
    pub(super) fn split(&mut self, scene: &Scene) -> Split {
        let now = scene.instances.iter().map(|instance| Seen {
            mesh: scene.meshes[instance.mesh as usize].hash,
            world_from_mesh: instance.world_from_mesh,
            visible: instance.visible,
        });
        let now: Vec<Seen> = now.collect();
        let is_edit = self.seen.len() == now.len() && self.seen.iter().zip(&now).all(|(a, b)| a.mesh == b.mesh);
        let moved: Vec<u32> =
            self.seen.iter().zip(&now).zip(0..).filter(|((a, b), _)| a != b).map(|(_, i)| i).collect();
        if is_edit && moved.len() <= MOST_MOVED {
            self.loose.extend(moved);
        } else {
            self.loose.clear();
        }
        if self.loose.len() > MOST_LOOSE {
            self.loose.clear();
        }
        self.seen = now;
        Split::of(scene, &self.loose)
    }

    /// A scene's shapes, and what is to be written into their tables; whoever does not write it gives up the cache.
    pub(super) fn shapes(
        &mut self,
        scene: &Scene,
        split: &Split,
        uploader: &mut Uploader<'_>,
    ) -> Result<(Arc<Shapes>, Edit), UploadError> {
        // Not both on the device at once, where they are built anew.
        let last = self.shapes.take().and_then(|(shapes, tables)| Some((Arc::into_inner(shapes)?, tables)));
        let grown = match last {
            Some(last) => self.grown_shapes(last, scene, split, uploader)?,
            None => None,
        };
        let (mut shapes, edit) = match grown {
            Some(grown) => grown,
            None => {
                let shapes = Shapes::build(scene, split, self.hierarchy, &mut self.blas);
                let tables = Tables::upload(&shapes, split.entries(), uploader)?;
                (shapes, Edit::none(tables))
            }
        };
        (shapes.nodes, shapes.positions) = (Vec::new(), Vec::new());
        let shapes = Arc::new(shapes);
        self.shapes = Some((shapes.clone(), edit.tables().clone()));
        Ok((shapes, edit))
    }

    /// Those of the last version, where this one's follow from them.
    fn grown_shapes(
        &mut self,
        (mut shapes, tables): (Shapes, Tables),
        scene: &Scene,
        split: &Split,
        uploader: &mut Uploader<'_>,
    ) -> Result<Option<(Shapes, Edit)>, UploadError> {
        let Some(growth) = shapes.grow(scene, split, self.hierarchy, &mut self.blas) else { return Ok(None) };
        let edit = tables.grown(&shapes, &growth, split.entries(), uploader)?;
        Ok(edit.map(|edit| (shapes, edit)))
    }

    pub(super) fn texels(&mut self, scene: &Scene, uploader: &mut Uploader<'_>) -> Result<Arc<TexelHeap>, UploadError> {
        let hash = scene.textures.iter().fold(ContentHash::default(), |hash, texture| {
            hash.mix(&texture.hash.0.to_le_bytes()).mix(&[texture.encoding as u8])
        });
        if let Some((known, texels)) = &self.texels
            && *known == hash
        {
            uploader.count(texels.bytes, false);
            return Ok(texels.clone());
        }
        self.texels = None;
        let texels = Arc::new(TexelHeap::upload(uploader.gpu, &scene.textures)?);
        uploader.count(texels.bytes, true);
        self.texels = Some((hash, texels.clone()));
        Ok(texels)
    }

    pub(super) fn environment(
        &mut self,
        environment: &Environment,
        uploader: &mut Uploader<'_>,
    ) -> Result<Arc<EnvironmentOnGpu>, UploadError> {
        let image = match environment {
            Environment::Constant(_) => None,
            Environment::Image { image, .. } => Some(image),
        };
        let hash = image.map(|image| image.hash);
        if let Some((known, on_gpu)) = &self.environment
            && *known == hash
        {
            uploader.count(on_gpu.bytes, false);
            return Ok(on_gpu.clone());
        }
        self.environment = None;
        let on_gpu = Arc::new(match image {
            None => EnvironmentOnGpu::constant(uploader.gpu),
            Some(image) => EnvironmentOnGpu::of(uploader.gpu, image)?,
        });
        uploader.count(on_gpu.bytes, true);
        self.environment = Some((hash, on_gpu.clone()));
        Ok(on_gpu)
    }

    /// The storage buffer of a table that is encoded anew for every version; `what` tells the tables apart.
    pub(super) fn table<T: bytemuck::NoUninit>(
        &mut self,
        what: &'static str,
        data: &[T],
        uploader: &mut Uploader<'_>,
    ) -> Result<wgpu::Buffer, UploadError> {
        let hash = ContentHash::of(&[bytemuck::cast_slice(data)]);
        if let Some((known, buffer)) = self.tables.get(what)
            && *known == hash
        {
            uploader.count(buffer.size(), false);
            return Ok(buffer.clone());
        }
        let buffer = uploader.storage(what, data)?;
        self.tables.insert(what, (hash, buffer.clone()));
        Ok(buffer)
    }

    pub(super) fn lobe_tables(&mut self, features: SceneFeatures, uploader: &mut Uploader<'_>) -> wgpu::TextureView {
        let needed = TABLE_FEATURES.map(|feature| features.contains(feature));
        if let Some((known, tables, bytes)) = &self.lobe_tables
            && *known == needed
        {
            uploader.count(*bytes, false);
            return tables.clone();
        }
        let (tables, bytes) = albedo::upload(uploader.gpu, features);
        uploader.count(bytes, true);
        self.lobe_tables = Some((needed, tables.clone(), bytes));
        tables
    }
}
