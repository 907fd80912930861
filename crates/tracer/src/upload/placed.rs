//! A scene's geometry on the device: shapes, and where they are placed.

use std::sync::Arc;

use super::{
    SceneCache, UploadError, Uploader,
    geometry::Shapes,
    placement::Placement,
    tables::{Edit, Tables},
};
use crate::{
    bvh::HierarchyKind,
    features::{Feature, SceneFeatures},
    kernels::KernelConstants,
    scene::Scene,
};

/// All that traversal needs but the instance table, which lights have a part in.
pub(super) struct Placed {
    pub shapes: Arc<Shapes>,
    pub placement: Placement,
    /// Of the shapes and the upper level, to be written into their tables.
    pub edit: Edit,
}

impl Placed {
    /// Builds what is not in `cache`, and uploads it but for the edit.
    pub(super) fn upload(
        scene: &Scene,
        cache: &mut SceneCache,
        uploader: &mut Uploader<'_>,
    ) -> Result<Self, UploadError> {
        let split = cache.split(scene);
        let (shapes, mut edit) = cache.shapes(scene, &split, uploader)?;
        let placement = Placement::of(scene, &split, cache.hierarchy(), &shapes);
        edit.add_upper_level(shapes.node_count, &placement.nodes);
        uploader.uploaded_bytes += edit.bytes();
        Ok(Self { shapes, placement, edit })
    }

    /// What a kernel must contain for the geometry.
    pub(super) fn features(&self, hierarchy: HierarchyKind) -> SceneFeatures {
        SceneFeatures::default()
            .with(Feature::Instances, !self.placement.is_single_level)
            .with(Feature::GeometryTextures, matches!(self.edit.tables(), Tables::Textures(_)))
            .with(Feature::BinaryNodes, hierarchy == HierarchyKind::Binary)
    }

    /// Numbers of the kernels.
    pub(super) fn constants(&self, environment_cells: [u32; 2]) -> KernelConstants {
        KernelConstants { stack_size: self.placement.stack_size, environment_cells }
    }
}
