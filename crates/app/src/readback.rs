//! Pictures of the device as values.

use anyhow::{Context, bail};
use tracer::gpu::Gpu;
use tracer::renderer::Renderer;
use tracer::view::ViewSettings;

/// Format of pictures: 8 bits, already encoded for the display.
pub const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Rays to first hits in one dispatch.
pub const FIRST_HITS_AT_ONCE: u32 = 1 << 15;

/// A texture that the renderer draws to, egui shows, and [`read_texture`] reads.
pub fn picture_texture(gpu: &Gpu, size: [u32; 2]) -> wgpu::Texture {
    picture_texture_in(gpu, size, PICTURE_FORMAT)
}

/// The same in another format of four bytes a pixel.
pub fn picture_texture_in(gpu: &Gpu, size: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// A texture that the window shows and [`write_texture`] fills.
pub fn upload_texture(gpu: &Gpu, size: [u32; 2]) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("mirror"),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: PICTURE_FORMAT,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Fills such a texture; `texels` must be as many as it has.
pub fn write_texture(queue: &wgpu::Queue, texture: &wgpu::Texture, texels: &[[u8; 4]]) {
    queue.write_texture(
        texture.as_image_copy(),
        texels.as_flattened(),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(texture.width() * 4), rows_per_image: None },
        texture.size(),
    );
}

/// Finds out whether the adapter can draw a picture.
///
/// # Errors
/// When it cannot.
pub fn check(gpu: &Gpu, settings: &ViewSettings) -> anyhow::Result<()> {
    let [width, height] = settings.size;
    let limit = gpu.device.limits().max_texture_dimension_2d;
    if width == 0 || height == 0 || width.max(height) > limit {
        bail!("a picture of {width}x{height} pixels is beyond adapter {}'s limit of {limit} a side", gpu.info().name);
    }
    Ok(settings.check(gpu)?)
}

/// Draws a view of the film and reads it back, row by row from the top. Finds the first hits that it shows.
///
/// # Errors
/// When the picture is larger than the adapter's textures or bindings, a kernel does not compile, or the device is lost.
pub fn draw(renderer: &mut Renderer, settings: &ViewSettings) -> anyhow::Result<Vec<[u8; 4]>> {
    let gpu = renderer.gpu().clone();
    check(&gpu, settings)?;
    while renderer.wants_first_hits(settings) && !renderer.trace_first_hits(settings, FIRST_HITS_AT_ONCE)? {}
    let texture = picture_texture(&gpu, settings.size);
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture") });
    renderer.present(
        &mut encoder,
        settings,
        &texture.create_view(&wgpu::TextureViewDescriptor::default()),
        PICTURE_FORMAT,
    )?;
    gpu.queue.submit([encoder.finish()]);
    read_texture(&gpu, &texture)
}

/// Texels of an 8-bit RGBA texture, waiting for the device.
///
/// # Errors
/// When the device is lost.
pub fn read_texture(gpu: &Gpu, texture: &wgpu::Texture) -> anyhow::Result<Vec<[u8; 4]>> {
    let row_bytes = texture.width() * 4;
    let padded = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("picture read-back"),
        size: u64::from(padded) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder =
        gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture read-back") });
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None },
        },
        texture.size(),
    );
    gpu.queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        // The receiver waits just below; it is gone only when polling failed.
        let _ = sender.send(result);
    });
    gpu.wait()?;
    receiver.recv().context("the graphics device was lost")?.context("the picture could not be read back")?;
    let mapped = staging.slice(..).get_mapped_range().context("the picture could not be read back")?;
    let mut texels = Vec::with_capacity(texture.width() as usize * texture.height() as usize);
    for row in mapped.chunks_exact(padded as usize) {
        texels.extend_from_slice(row[..row_bytes as usize].as_chunks().0);
    }
    Ok(texels)
}
