//! The geometry's tables on the device: in storage buffers, or in texture pages, which a binding's size does not bound.
//! Twin: `shaders/scene/tables.wesl`.

use super::{
    UploadError, Uploader,
    geometry::{Growth, Shapes},
    pages::Pages,
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
        let largest = sizes(shapes, upper_nodes);
        if uploader.gpu.keeps_in_buffers(largest) {
            uploader.check_memory("geometry", largest.iter().sum())?;
            return Ok(Self::Buffers([
                uploader.storage(LABELS[0], &shapes.nodes)?,
                uploader.storage(LABELS[1], &shapes.positions)?,
                uploader.storage(LABELS[2], &shapes.triangles)?,
                uploader.storage(LABELS[3], &shapes.vertices)?,
            ]));
        }
        let texels = (shapes.node_count as usize + upper_nodes) * NODE_TEXELS
            + shapes.triangles.len() * (CORNERS + 1)
            + shapes.vertices.len() * VERTEX_TEXELS;
        uploader.check_memory("geometry", (texels * size_of::<Texel>()) as u64)?;
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

    /// These tables with what shapes have grown by since; `None` where they would no longer be what these are.
    pub(super) fn grown(
        &self,
        shapes: &Shapes,
        growth: &Growth,
        upper_nodes: usize,
        uploader: &mut Uploader<'_>,
    ) -> Result<Option<Self>, UploadError> {
        let tails = (
            &shapes.nodes,
            &shapes.positions,
            &shapes.triangles[growth.triangles..],
            &shapes.vertices[growth.vertices..],
        );
        match self {
            Self::Buffers(buffers) => {
                if !uploader.gpu.keeps_in_buffers(sizes(shapes, upper_nodes)) {
                    return Ok(None);
                }
                let [nodes, positions, triangles, vertices] = buffers;
                let at = growth.nodes as usize;
                let nodes = uploader.longer(LABELS[0], (nodes, at), tails.0)?;
                let positions = uploader.longer(LABELS[1], (positions, growth.triangles), tails.1)?;
                let triangles = uploader.longer(LABELS[2], (triangles, growth.triangles), tails.2)?;
                let vertices = uploader.longer(LABELS[3], (vertices, growth.vertices), tails.3)?;
                let mut encoder = uploader.gpu.device.create_command_encoder(&Default::default());
                for run in &growth.gone {
                    let [at, bytes] =
                        [run.start, run.len() as u32].map(|n| u64::from(n) * size_of::<[f32; 9]>() as u64);
                    encoder.clear_buffer(&positions, at, Some(bytes));
                }
                uploader.gpu.queue.submit([encoder.finish()]);
                Ok(Some(Self::Buffers([nodes, positions, triangles, vertices])))
            }
            Self::Textures(tables) => {
                let heads = [
                    growth.nodes as usize * NODE_TEXELS,
                    growth.triangles * CORNERS,
                    growth.triangles,
                    growth.vertices * VERTEX_TEXELS,
                ];
                let texels: [Vec<Texel>; 4] = [
                    tails.0.iter().flat_map(node_texels).collect(),
                    tails.1.iter().flat_map(corner_texels).collect(),
                    tails.2.to_vec(),
                    tails.3.iter().flat_map(vertex_texels).collect(),
                ];
                let mut longer = |i: usize| uploader.longer_pages(LABELS[i], (&tables[i], heads[i]), &texels[i]);
                let [nodes, positions, triangles, vertices] = [longer(0)?, longer(1)?, longer(2)?, longer(3)?];
                for run in &growth.gone {
                    let corners = vec![[0; 4]; run.len() * CORNERS];
                    positions.put::<Texel>(uploader.gpu, run.start as usize * CORNERS, &corners);
                }
                Ok(Some(Self::Textures(Box::new([nodes, positions, triangles, vertices]))))
            }
        }
    }

    /// These tables with an upper level, if there is one, behind `shape_nodes` nodes, and its root in the place of the first node.
    pub(super) fn with_upper_level(
        &self,
        shape_nodes: u32,
        upper: &[Node],
        uploader: &mut Uploader<'_>,
    ) -> Result<Self, UploadError> {
        let Some(root) = upper.first() else { return Ok(self.clone()) };
        let shape_nodes = shape_nodes as usize;
        match self {
            Self::Buffers([nodes, others @ ..]) => {
                let nodes = uploader.longer(LABELS[0], (nodes, shape_nodes), upper)?;
                uploader.gpu.queue.write_buffer(&nodes, 0, bytemuck::bytes_of(root));
                let [positions, triangles, vertices] = others.clone();
                Ok(Self::Buffers([nodes, positions, triangles, vertices]))
            }
            Self::Textures(tables) => {
                let texels: Vec<Texel> = upper.iter().flat_map(node_texels).collect();
                let nodes = uploader.longer_pages(LABELS[0], (&tables[0], shape_nodes * NODE_TEXELS), &texels)?;
                nodes.put(uploader.gpu, 0, &node_texels(root));
                let mut tables = tables.clone();
                tables[0] = nodes;
                Ok(Self::Textures(tables))
            }
        }
    }
}

/// Bytes of each table, with room for an upper level of so many nodes.
fn sizes(shapes: &Shapes, upper_nodes: usize) -> [u64; 4] {
    [
        (shapes.node_count as usize + upper_nodes) * size_of::<Node>(),
        shapes.triangles.len() * size_of::<[f32; 9]>(),
        size_of_val(&shapes.triangles[..]),
        size_of_val(&shapes.vertices[..]),
    ]
    .map(|bytes| bytes as u64)
}

impl Uploader<'_> {
    /// The first `rows` of a buffer, and more.
    fn longer<T: bytemuck::NoUninit>(
        &mut self,
        what: &'static str,
        (start, rows): (&wgpu::Buffer, usize),
        more: &[T],
    ) -> Result<wgpu::Buffer, UploadError> {
        let head = (rows * size_of::<T>()) as u64;
        self.appended(what, (start, head), (head, more))
    }

    /// The first `head` texels of a stack of pages, and more.
    fn longer_pages(
        &mut self,
        what: &'static str,
        (start, head): (&Pages, usize),
        more: &[Texel],
    ) -> Result<Pages, UploadError> {
        let pages = self.empty_pages(what, head + more.len(), more.len())?;
        pages.copy_from(self.gpu, start);
        pages.put(self.gpu, head, more);
        Ok(pages)
    }

    fn empty_pages(&mut self, what: &'static str, texels: usize, new_texels: usize) -> Result<Pages, UploadError> {
        let binding = wgpu::TextureUsages::STORAGE_BINDING;
        let pages = Pages::new(self.gpu, what, wgpu::TextureFormat::Rgba32Uint, binding, texels as u64)?;
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
        pages.fill(self.gpu, texels);
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
