//! The geometry's tables on the device: in storage buffers, or in texture pages, which a binding's size does not bound.
//! Twin: `shaders/scene/tables.wesl`.

use super::{
    UploadError, Uploader,
    geometry::Shapes,
    pages::{PAGE, Pages},
    placement::rounded_up,
};
use crate::{bvh::Node, kernels::layout::Vertex};

/// Nodes, positions, triangles, vertices.
#[derive(Clone, Debug)]
pub(super) enum Tables {
    /// As they are on the host.
    Buffers([wgpu::Buffer; 4]),
    /// In texels of four words: five a node, three a triangle (a corner in each), one a triangle, three a vertex.
    Textures(Box<[Pages; 4]>),
}

const LABELS: [&str; 4] = ["hierarchy nodes", "triangle positions", "triangles", "vertices"];
const NODE_TEXELS: usize = 5;
const CORNERS: usize = 3;
const VERTEX_TEXELS: usize = 3;

type Texel = [u32; 4];

impl Tables {
    /// Uploads the shapes' tables; an upper level of at most `upper_nodes` nodes is to join them.
    pub(super) fn upload(
        shapes: &Shapes,
        upper_nodes: usize,
        uploader: &mut Uploader<'_>,
    ) -> Result<Self, UploadError> {
        let nodes = rounded_up(shapes.nodes.len() as u32) as usize + upper_nodes;
        let largest = [
            nodes * size_of::<Node>(),
            size_of_val(&shapes.positions[..]),
            size_of_val(&shapes.triangles[..]),
            size_of_val(&shapes.vertices[..]),
        ];
        uploader.check_memory("geometry", largest.iter().sum::<usize>() as u64)?;
        if uploader.gpu.keeps_in_buffers(largest.map(|bytes| bytes as u64)) {
            return Ok(Self::Buffers([
                uploader.storage(LABELS[0], &shapes.nodes)?,
                uploader.storage(LABELS[1], &shapes.positions)?,
                uploader.storage(LABELS[2], &shapes.triangles)?,
                uploader.storage(LABELS[3], &shapes.vertices)?,
            ]));
        }
        let nodes = shapes.nodes.iter().flat_map(node_texels);
        let positions = shapes.positions.iter().flat_map(corner_texels);
        let vertices = shapes.vertices.iter().flat_map(vertex_texels);
        Ok(Self::Textures(Box::new([
            uploader.pages(LABELS[0], shapes.nodes.len() * NODE_TEXELS, nodes)?,
            uploader.pages(LABELS[1], shapes.positions.len() * CORNERS, positions)?,
            uploader.pages(LABELS[2], shapes.triangles.len(), shapes.triangles.iter().copied())?,
            uploader.pages(LABELS[3], shapes.vertices.len() * VERTEX_TEXELS, vertices)?,
        ])))
    }

    /// As group 1 of the path kernels binds them.
    pub(super) fn resources(&self) -> Vec<(u32, wgpu::BindingResource<'_>)> {
        match self {
            Self::Buffers(buffers) => (0..).zip(buffers.iter().map(wgpu::Buffer::as_entire_binding)).collect(),
            Self::Textures(tables) => {
                let views = tables.iter().map(|pages| wgpu::BindingResource::TextureView(&pages.view));
                (13..).zip(views).collect()
            }
        }
    }

    /// On the device.
    pub(super) fn bytes(&self) -> u64 {
        match self {
            Self::Buffers(buffers) => buffers.iter().map(wgpu::Buffer::size).sum(),
            Self::Textures(tables) => tables.iter().map(Pages::bytes).sum(),
        }
    }

    /// The first node of an upper level behind `shape_nodes` nodes.
    pub(super) fn upper_root(&self, shape_nodes: u32) -> u32 {
        match self {
            Self::Buffers(_) => rounded_up(shape_nodes),
            // At the beginning of a row.
            Self::Textures(_) => rounded_up(shape_nodes).next_multiple_of(PAGE),
        }
    }

    /// These tables with an upper level from node `root` on.
    pub(super) fn with_upper_level(
        &self,
        shape_nodes: u32,
        root: u32,
        upper: &[Node],
        uploader: &mut Uploader<'_>,
    ) -> Result<Self, UploadError> {
        match self {
            Self::Buffers([nodes, others @ ..]) => {
                let bytes = |nodes: u32| u64::from(nodes) * size_of::<Node>() as u64;
                let nodes = uploader.appended(LABELS[0], (nodes, bytes(shape_nodes)), (bytes(root), upper))?;
                let [positions, triangles, vertices] = others.clone();
                Ok(Self::Buffers([nodes, positions, triangles, vertices]))
            }
            Self::Textures(tables) => {
                let texels = (root as usize + upper.len()) * NODE_TEXELS;
                let nodes = uploader.empty_pages(LABELS[0], texels, upper.len() * NODE_TEXELS)?;
                nodes.copy_from(uploader.gpu, &tables[0]);
                nodes.write(uploader.gpu, root / PAGE * NODE_TEXELS as u32, upper.iter().flat_map(node_texels));
                let mut tables = tables.clone();
                tables[0] = nodes;
                Ok(Self::Textures(tables))
            }
        }
    }
}

impl Uploader<'_> {
    fn empty_pages(&mut self, what: &'static str, texels: usize, new_texels: usize) -> Result<Pages, UploadError> {
        let pages = Pages::new(self.gpu, what, wgpu::TextureFormat::Rgba32Uint, texels as u64)?;
        self.device_bytes += pages.bytes();
        self.uploaded_bytes += (new_texels * size_of::<Texel>()) as u64;
        Ok(pages)
    }

    fn pages(
        &mut self,
        what: &'static str,
        count: usize,
        texels: impl Iterator<Item = Texel>,
    ) -> Result<Pages, UploadError> {
        let pages = self.empty_pages(what, count, count)?;
        pages.write(self.gpu, 0, texels);
        Ok(pages)
    }
}

fn node_texels(node: &Node) -> [Texel; NODE_TEXELS] {
    bytemuck::cast(*node)
}

fn corner_texels(corners: &[f32; 9]) -> [Texel; CORNERS] {
    let w: [u32; 9] = corners.map(f32::to_bits);
    [[w[0], w[1], w[2], 0], [w[3], w[4], w[5], 0], [w[6], w[7], w[8], 0]]
}

fn vertex_texels(vertex: &Vertex) -> [Texel; VERTEX_TEXELS] {
    let w: [u32; 9] = bytemuck::cast(*vertex);
    [[w[0], w[1], w[2], w[3]], [w[4], w[5], w[6], w[7]], [w[8], 0, 0, 0]]
}
