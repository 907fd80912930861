//! Draws the picture onto the window, below all that egui draws.

use egui::{PaintCallbackInfo, Rect, Shape};
use egui_wgpu::{Callback, CallbackResources, CallbackTrait, ScreenDescriptor};

use super::engine::Picture;

/// The picture as a shape that fills a rectangle; `format` is the window's.
pub fn shape(picture: Picture, rect: Rect, format: wgpu::TextureFormat) -> Shape {
    Callback::new_paint_callback(rect, Draw { picture, format }).into()
}

struct Draw {
    picture: Picture,
    format: wgpu::TextureFormat,
}

/// What is kept from frame to frame.
struct Canvas {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    /// With the generation of its texture.
    bound: Option<(u64, wgpu::BindGroup)>,
}

impl CallbackTrait for Draw {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _: &ScreenDescriptor,
        _: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        self.picture.bring(queue);
        let canvas = resources.entry().or_insert_with(|| Canvas::new(device, self.format));
        canvas.bind(device, &self.picture);
        Vec::new()
    }

    fn paint(&self, _: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, resources: &CallbackResources) {
        let Some(canvas) = resources.get::<Canvas>() else { return };
        let Some((_, group)) = &canvas.bound else { return };
        pass.set_pipeline(&canvas.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }
}

impl Canvas {
    fn new(device: &wgpu::Device, format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("view::window"),
            source: wgpu::ShaderSource::Wgsl(include_str!("../../../../shaders/view/window.wgsl").into()),
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("view::window"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(if format.is_srgb() { "decoded" } else { "encoded" }),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("view::window"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        Self { layout: pipeline.get_bind_group_layout(0), pipeline, sampler, bound: None }
    }

    fn bind(&mut self, device: &wgpu::Device, picture: &Picture) {
        if self.bound.as_ref().is_some_and(|(generation, _)| *generation == picture.generation) {
            return;
        }
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("view::window"),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&picture.texture) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&self.sampler) },
            ],
        });
        self.bound = Some((picture.generation, group));
    }
}
