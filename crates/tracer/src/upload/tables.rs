//! The geometry's tables on the device: in storage buffers, or in texture pages, which a binding's size does not bound.
//! Twin: `shaders/scene/tables.wesl`.
//!
//! Tables have room for an upper level and for objects that leave the static mesh, so that an edit writes its rows in place. It
//! does so when the new version of the scene is sure to be used ([`Edit::write`]); until then the last one can be gone back to.

use super::{
    UploadError, Uploader,
    geometry::{Growth, Shapes},
    pages::Pages,
};
use crate::{bvh::Node, gpu::Gpu, kernels::layout::Vertex};

/// Nodes, positions, triangles, vertices.
#[derive(Clone, Debug)]
pub(super) enum Tables {
    /// As they are on the host.
    Buffers([wgpu::Buffer; 4]),
    /// In texels of four words: five a node, three a triangle (a corner in each), one a triangle, three a vertex.
    Textures(Box<[Pages; 4]>),
}

/// What is to be written into tables for another version of a scene.
#[derive(Debug)]
#[must_use = "the tables lack it until it is written"]
pub struct Edit {
    tables: Tables,
    rows: Vec<Rows>,
}

/// Successive rows of one table.
#[derive(Debug)]
struct Rows {
    table: usize,
    first: usize,
    /// As the table has them.
    bytes: Vec<u8>,
}

const LABELS: [&str; 4] = ["hierarchy nodes", "triangle positions", "triangles", "vertices"];
const NODES: usize = 0;
const POSITIONS: usize = 1;
const TRIANGLES: usize = 2;
const VERTICES: usize = 3;
/// Bytes of a row in a buffer.
const ROW_BYTES: [usize; 4] = [size_of::<Node>(), size_of::<[f32; 9]>(), size_of::<[u32; 4]>(), size_of::<Vertex>()];
/// Texels of a row in pages.
const ROW_TEXELS: [usize; 4] = [5, 3, 1, 3];

/// A table has room for one part in so many of what it holds,
const ROOM_PART: usize = 8;
/// but for so many bytes at most.
const ROOM_BYTES: usize = 8 << 20;

type Texel = [u32; 4];

impl Tables {
    /// Uploads the shapes' tables; an upper level of at most `upper_nodes` nodes is to join them.
    pub(super) fn upload(
        shapes: &Shapes,
        upper_nodes: usize,
        uploader: &mut Uploader<'_>,
    ) -> Result<Self, UploadError> {
        let rows = rows_needed(shapes, upper_nodes);
        let in_buffers = is_in_buffers(rows, uploader);
        let bytes =
            |table: usize| if in_buffers { buffer_bytes(table, rows[table]) } else { page_bytes(table, rows[table]) };
        uploader.check_memory("geometry", (0..4).map(bytes).sum())?;
        let tables = if in_buffers {
            Self::Buffers([
                uploader.table_buffer(NODES, rows[NODES], bytemuck::cast_slice(&shapes.nodes))?,
                uploader.table_buffer(POSITIONS, rows[POSITIONS], bytemuck::cast_slice(&shapes.positions))?,
                uploader.table_buffer(TRIANGLES, rows[TRIANGLES], bytemuck::cast_slice(&shapes.triangles))?,
                uploader.table_buffer(VERTICES, rows[VERTICES], bytemuck::cast_slice(&shapes.vertices))?,
            ])
        } else {
            let nodes = uploader.table_pages(NODES, rows[NODES])?;
            nodes.fill(uploader.gpu, shapes.nodes.iter().flat_map(node_texels));
            let positions = uploader.table_pages(POSITIONS, rows[POSITIONS])?;
            positions.fill(uploader.gpu, shapes.positions.iter().flat_map(corner_texels));
            let triangles = uploader.table_pages(TRIANGLES, rows[TRIANGLES])?;
            triangles.fill(uploader.gpu, shapes.triangles.iter().copied());
            let vertices = uploader.table_pages(VERTICES, rows[VERTICES])?;
            vertices.fill(uploader.gpu, shapes.vertices.iter().flat_map(vertex_texels));
            Self::Textures(Box::new([nodes, positions, triangles, vertices]))
        };
        uploader.count(tables.bytes(), true);
        Ok(tables)
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

    /// These tables, or larger ones with what these hold, and what is to be written into them for what shapes have grown by since.
    /// `None` where they would no longer be what these are.
    pub(super) fn grown(
        &self,
        shapes: &Shapes,
        growth: &Growth,
        upper_nodes: usize,
        uploader: &mut Uploader<'_>,
    ) -> Result<Option<Edit>, UploadError> {
        let rows = rows_needed(shapes, upper_nodes);
        let tables = match self {
            Self::Buffers(_) if !is_in_buffers(rows, uploader) => return Ok(None),
            Self::Buffers([nodes, positions, triangles, vertices]) => Self::Buffers([
                uploader.buffer_with_room(NODES, rows[NODES], nodes)?,
                uploader.buffer_with_room(POSITIONS, rows[POSITIONS], positions)?,
                uploader.buffer_with_room(TRIANGLES, rows[TRIANGLES], triangles)?,
                uploader.buffer_with_room(VERTICES, rows[VERTICES], vertices)?,
            ]),
            Self::Textures(tables) => Self::Textures(Box::new([
                uploader.pages_with_room(NODES, rows[NODES], &tables[NODES])?,
                uploader.pages_with_room(POSITIONS, rows[POSITIONS], &tables[POSITIONS])?,
                uploader.pages_with_room(TRIANGLES, rows[TRIANGLES], &tables[TRIANGLES])?,
                uploader.pages_with_room(VERTICES, rows[VERTICES], &tables[VERTICES])?,
            ])),
        };
        uploader.count(tables.bytes(), false);
        let mut edit = Edit::none(tables);
        edit.push(NODES, growth.nodes as usize, &shapes.nodes, node_texels);
        edit.push(POSITIONS, growth.triangles, &shapes.positions, corner_texels);
        edit.push(TRIANGLES, growth.triangles, &shapes.triangles[growth.triangles..], |&texel| [texel]);
        edit.push(VERTICES, growth.vertices, &shapes.vertices[growth.vertices..], vertex_texels);
        for run in &growth.gone {
            edit.push(POSITIONS, run.start as usize, &vec![[0.0; 9]; run.len()], corner_texels);
        }
        Ok(Some(edit))
    }
}

impl Edit {
    /// Nothing that is to be written into these.
    pub(super) fn none(tables: Tables) -> Self {
        Self { tables, rows: Vec::new() }
    }

    /// The tables as they will be.
    pub(super) fn tables(&self) -> &Tables {
        &self.tables
    }

    /// Adds an upper level, if there is one, behind `shape_nodes` nodes, and its root in the place of the first node.
    pub(super) fn add_upper_level(&mut self, shape_nodes: u32, upper: &[Node]) {
        self.push(NODES, shape_nodes as usize, upper, node_texels);
        self.push(NODES, 0, &upper[..upper.len().min(1)], node_texels);
    }

    /// Bytes to be written.
    pub(super) fn bytes(&self) -> u64 {
        self.rows.iter().map(|rows| rows.bytes.len() as u64).sum()
    }

    /// Writes it, before what is submitted from now on.
    pub fn write(self, gpu: &Gpu) {
        for Rows { table, first, bytes } in &self.rows {
            match &self.tables {
                Tables::Buffers(buffers) => {
                    gpu.queue.write_buffer(&buffers[*table], (first * ROW_BYTES[*table]) as u64, bytes);
                }
                Tables::Textures(tables) => {
                    tables[*table].put::<Texel>(gpu, first * ROW_TEXELS[*table], bytemuck::cast_slice(bytes));
                }
            }
        }
    }

    fn push<T: bytemuck::NoUninit, const N: usize>(
        &mut self,
        table: usize,
        first: usize,
        rows: &[T],
        texels: impl Fn(&T) -> [Texel; N],
    ) {
        if rows.is_empty() {
            return;
        }
        let bytes = match &self.tables {
            Tables::Buffers(_) => bytemuck::cast_slice(rows).to_vec(),
            Tables::Textures(_) => {
                let texels: Vec<Texel> = rows.iter().flat_map(texels).collect();
                bytemuck::cast_slice(&texels).to_vec()
            }
        };
        self.rows.push(Rows { table, first, bytes });
    }
}

impl Uploader<'_> {
    /// With room for `rows` and more.
    fn table_buffer(&self, table: usize, rows: usize, contents: &[u8]) -> Result<wgpu::Buffer, UploadError> {
        self.check(LABELS[table], (rows * ROW_BYTES[table]) as u64)?;
        let size = buffer_bytes(table, rows).min(self.gpu.largest_binding());
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Ok(self.gpu.buffer_with_room(LABELS[table], contents, size, usage))
    }

    /// With room for `rows` and more.
    fn table_pages(&self, table: usize, rows: usize) -> Result<Pages, UploadError> {
        let (format, binding) = (wgpu::TextureFormat::Rgba32Uint, wgpu::TextureUsages::STORAGE_BINDING);
        let texels = page_bytes(table, rows) / size_of::<Texel>() as u64;
        Pages::new(self.gpu, LABELS[table], format, binding, texels)
    }

    /// The same one, or where it is too small for so many rows a larger one that begins with what it holds.
    fn buffer_with_room(&self, table: usize, rows: usize, now: &wgpu::Buffer) -> Result<wgpu::Buffer, UploadError> {
        if (rows * ROW_BYTES[table]) as u64 <= now.size() {
            return Ok(now.clone());
        }
        self.check_memory(LABELS[table], buffer_bytes(table, rows))?;
        let larger = self.table_buffer(table, rows, &[])?;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(now, 0, &larger, 0, now.size());
        self.gpu.queue.submit([encoder.finish()]);
        Ok(larger)
    }

    /// The same ones, or where they are too few for so many rows more that begin with what they hold.
    fn pages_with_room(&self, table: usize, rows: usize, now: &Pages) -> Result<Pages, UploadError> {
        if (rows * ROW_TEXELS[table] * size_of::<Texel>()) as u64 <= now.bytes() {
            return Ok(now.clone());
        }
        self.check_memory(LABELS[table], page_bytes(table, rows))?;
        let larger = self.table_pages(table, rows)?;
        larger.copy_from(self.gpu, now);
        Ok(larger)
    }
}

/// Of a table in a buffer, with room.
fn buffer_bytes(table: usize, rows: usize) -> u64 {
    with_room(rows * ROW_BYTES[table]).next_multiple_of(16).max(16)
}

/// Of a table in pages, with room.
fn page_bytes(table: usize, rows: usize) -> u64 {
    with_room(rows * ROW_TEXELS[table] * size_of::<Texel>())
}

fn with_room(bytes: usize) -> u64 {
    (bytes + (bytes / ROOM_PART).min(ROOM_BYTES)) as u64
}

/// Rows of each table, with an upper level of so many nodes.
fn rows_needed(shapes: &Shapes, upper_nodes: usize) -> [usize; 4] {
    let triangles = shapes.triangles.len();
    [shapes.node_count as usize + upper_nodes, triangles, triangles, shapes.vertices.len()]
}

/// Whether tables of so many rows are to be in buffers.
fn is_in_buffers(rows: [usize; 4], uploader: &Uploader<'_>) -> bool {
    uploader.gpu.keeps_in_buffers([0, 1, 2, 3].map(|table| (rows[table] * ROW_BYTES[table]) as u64))
}

fn node_texels(node: &Node) -> [Texel; ROW_TEXELS[NODES]] {
    bytemuck::cast(*node)
}

fn corner_texels(corners: &[f32; 9]) -> [Texel; ROW_TEXELS[POSITIONS]] {
    let w: [u32; 9] = corners.map(f32::to_bits);
    [[w[0], w[1], w[2], 0], [w[3], w[4], w[5], 0], [w[6], w[7], w[8], 0]]
}

fn vertex_texels(vertex: &Vertex) -> [Texel; ROW_TEXELS[VERTICES]] {
    let w: [u32; 9] = bytemuck::cast(*vertex);
    [[w[0], w[1], w[2], w[3]], [w[4], w[5], w[6], w[7]], [w[8], 0, 0, 0]]
}
