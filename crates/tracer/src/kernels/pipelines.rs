//! Pipelines made of composed kernels, with the bindings that each kernel really has.

use std::{collections::HashMap, sync::Arc};

use thiserror::Error;

use super::{ComposeError, KernelKey, compose};
use crate::gpu::Complaints;

/// Why a kernel has no pipeline.
#[derive(Debug, Error)]
pub enum KernelError {
    /// Its modules do not compose.
    #[error(transparent)]
    Compose(#[from] ComposeError),
    /// The composed text is not WGSL.
    #[error("kernel {kernel}: {cause}")]
    Wgsl {
        /// The key's label.
        kernel: String,
        /// The parser's words.
        cause: String,
    },
    /// The driver refused.
    #[error("the driver does not compile kernel {kernel}: {cause}")]
    Driver {
        /// The key's label.
        kernel: String,
        /// The driver's words.
        cause: String,
    },
}

/// A compiled kernel: compute, or a render pipeline where [`Kernel::draws`](super::Kernel::draws).
#[derive(Debug)]
pub struct Pipeline {
    kind: PipelineKind,
    groups: Vec<(wgpu::BindGroupLayout, Vec<u32>)>,
    label: String,
}

#[derive(Debug)]
enum PipelineKind {
    Compute(wgpu::ComputePipeline),
    Render(wgpu::RenderPipeline),
}

impl Pipeline {
    /// Compiles a kernel, for targets of a format where it draws.
    ///
    /// # Errors
    /// When it does not compose or compile.
    pub fn create(
        device: &wgpu::Device,
        key: &KernelKey,
        target: Option<wgpu::TextureFormat>,
    ) -> Result<Self, KernelError> {
        let label = key.to_string();
        let text = compose(key)?;
        let module = naga::front::wgsl::parse_str(&text)
            .map_err(|error| KernelError::Wgsl { kernel: label.clone(), cause: error.emit_to_string(&text) })?;
        let stages = if key.kernel.draws() {
            wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::VERTEX
        } else {
            wgpu::ShaderStages::COMPUTE
        };
        let complaints = Complaints::of(device);
        let groups = reflect(device, &module, stages, &label);
        let layouts: Vec<_> = groups.iter().map(|(layout, _)| Some(layout)).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&label),
            bind_group_layouts: &layouts,
            immediate_size: 0,
        });
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(&label), source: wgpu::ShaderSource::Wgsl(text.into()) };
        // Clamping every index and counting every loop takes a fifth of the traversal's time on lavapipe (docs/ARCHITECTURE.md).
        let checks = wgpu::ShaderRuntimeChecks {
            bounds_checks: false,
            force_loop_bounding: false,
            ..wgpu::ShaderRuntimeChecks::checked()
        };
        // SAFETY: the kernels' indices come from tables that this crate builds from a scene whose own indices the host has
        // followed while building them, from pixels of the bound film, and from counters below an array's length; every loop
        // ends when a finite hierarchy, list or number of bounces is used up.
        #[expect(unsafe_code, reason = "the only way to leave the checks out")]
        let shader = unsafe { device.create_shader_module_trusted(descriptor, checks) };
        let kind = match target {
            None => PipelineKind::Compute(device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&label),
                layout: Some(&layout),
                module: &shader,
                entry_point: Some(key.kernel.entry_point()),
                compilation_options: Default::default(),
                cache: None,
            })),
            Some(format) => PipelineKind::Render(device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(&label),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &shader,
                    entry_point: Some("cover"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: Default::default(),
                depth_stencil: None,
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &shader,
                    entry_point: Some(key.kernel.entry_point()),
                    compilation_options: Default::default(),
                    targets: &[Some(format.into())],
                }),
                multiview_mask: None,
                cache: None,
            })),
        };
        if let Some(error) = complaints.end() {
            return Err(KernelError::Driver { kernel: label, cause: error.to_string() });
        }
        Ok(Self { kind, groups, label })
    }

    /// The key's label.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// A bind group of what the kernel uses among `resources`.
    pub fn bind(
        &self,
        device: &wgpu::Device,
        group: usize,
        resources: &[(u32, wgpu::BindingResource<'_>)],
    ) -> Option<wgpu::BindGroup> {
        let (layout, used) = self.groups.get(group)?;
        let entries: Vec<_> = resources
            .iter()
            .filter(|(binding, _)| used.contains(binding))
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
            .collect();
        Some(device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&self.label),
            layout,
            entries: &entries,
        }))
    }

    /// Sets a compute pass to this kernel and dispatches it.
    ///
    /// # Panics
    /// On a render pipeline, which is a bug in this crate.
    pub fn dispatch(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        groups: &[&Option<wgpu::BindGroup>],
        workgroups: [u32; 2],
    ) {
        self.set(pass, groups);
        pass.dispatch_workgroups(workgroups[0], workgroups[1], 1);
    }

    /// The same with as many workgroups as a buffer says: three words, for the axes.
    ///
    /// # Panics
    /// On a render pipeline, which is a bug in this crate.
    pub fn dispatch_indirect(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        groups: &[&Option<wgpu::BindGroup>],
        workgroups: &wgpu::Buffer,
    ) {
        self.set(pass, groups);
        pass.dispatch_workgroups_indirect(workgroups, 0);
    }

    fn set(&self, pass: &mut wgpu::ComputePass<'_>, groups: &[&Option<wgpu::BindGroup>]) {
        let PipelineKind::Compute(pipeline) = &self.kind else { panic!("{} is no compute kernel", self.label) };
        pass.set_pipeline(pipeline);
        for (index, group) in groups.iter().enumerate() {
            if let Some(group) = group {
                pass.set_bind_group(index as u32, group, &[]);
            }
        }
    }

    /// Covers a target with this kernel, in a pass of its own: all of it whatever it holds, or only a `part` (left, top, width,
    /// height in pixels), and the rest stays.
    ///
    /// # Panics
    /// On a compute kernel, which is a bug in this crate.
    pub fn cover(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        groups: &[&Option<wgpu::BindGroup>],
        part: Option<[u32; 4]>,
    ) {
        let PipelineKind::Render(pipeline) = &self.kind else { panic!("{} is no render kernel", self.label) };
        let load = if part.is_some() { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(wgpu::Color::BLACK) };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(&self.label),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        if let Some([left, top, width, height]) = part {
            pass.set_scissor_rect(left, top, width, height);
        }
        pass.set_pipeline(pipeline);
        for (index, group) in groups.iter().enumerate() {
            if let Some(group) = group {
                pass.set_bind_group(index as u32, group, &[]);
            }
        }
        pass.draw(0..3, 0..1);
    }
}

/// Bind group layouts of the module's global variables, and the bindings in each.
fn reflect(
    device: &wgpu::Device,
    module: &naga::Module,
    visibility: wgpu::ShaderStages,
    label: &str,
) -> Vec<(wgpu::BindGroupLayout, Vec<u32>)> {
    let mut groups: Vec<Vec<wgpu::BindGroupLayoutEntry>> = Vec::new();
    let is_sampler =
        |variable: &naga::GlobalVariable| matches!(module.types[variable.ty].inner, naga::TypeInner::Sampler { .. });
    // Kernels without a sampler read texels alone, of formats that need not be filterable.
    let filterable = module.global_variables.iter().any(|(_, variable)| is_sampler(variable));
    for (_, variable) in module.global_variables.iter() {
        let Some(binding) = variable.binding else { continue };
        let ty = match variable.space {
            naga::AddressSpace::Uniform => buffer_type(wgpu::BufferBindingType::Uniform),
            naga::AddressSpace::Storage { access } => buffer_type(wgpu::BufferBindingType::Storage {
                read_only: !access.contains(naga::StorageAccess::STORE),
            }),
            _ if is_sampler(variable) => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
            _ => {
                let naga::TypeInner::Image { arrayed, class, .. } = module.types[variable.ty].inner else { continue };
                let view_dimension =
                    if arrayed { wgpu::TextureViewDimension::D2Array } else { wgpu::TextureViewDimension::D2 };
                match class {
                    // The geometry's tables; nothing else is a storage texture.
                    naga::ImageClass::Storage { .. } => wgpu::BindingType::StorageTexture {
                        access: wgpu::StorageTextureAccess::ReadOnly,
                        format: wgpu::TextureFormat::Rgba32Uint,
                        view_dimension,
                    },
                    _ => wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Float { filterable },
                        view_dimension,
                        multisampled: false,
                    },
                }
            }
        };
        let group = binding.group as usize;
        groups.resize_with(groups.len().max(group + 1), Vec::new);
        groups[group].push(wgpu::BindGroupLayoutEntry { binding: binding.binding, visibility, ty, count: None });
    }
    groups
        .into_iter()
        .map(|mut entries| {
            entries.sort_by_key(|entry| entry.binding);
            let layout = device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries });
            (layout, entries.iter().map(|entry| entry.binding).collect())
        })
        .collect()
}

fn buffer_type(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

/// Pipelines that are kept at most. A scene needs about ten; versions of one that add features or move parts need others.
const MOST_KEPT: usize = 48;

type CacheKey = (KernelKey, Option<wgpu::TextureFormat>);

/// Pipelines by key; clones share what was made until then. Those that were not asked for longest are forgotten, and made again if
/// they are needed.
#[derive(Clone, Debug, Default)]
pub struct PipelineCache {
    known: HashMap<CacheKey, (Arc<Pipeline>, u64)>,
    /// Counts what was asked for.
    asked: u64,
}

impl PipelineCache {
    /// The pipeline of a compute kernel.
    ///
    /// # Errors
    /// When it does not compose or compile.
    pub fn compute(&mut self, device: &wgpu::Device, key: &KernelKey) -> Result<Arc<Pipeline>, KernelError> {
        self.get(device, key, None)
    }

    /// The pipeline of a kernel that draws to targets of this format.
    ///
    /// # Errors
    /// When it does not compose or compile.
    pub fn drawn(
        &mut self,
        device: &wgpu::Device,
        key: &KernelKey,
        format: wgpu::TextureFormat,
    ) -> Result<Arc<Pipeline>, KernelError> {
        self.get(device, key, Some(format))
    }

    fn get(
        &mut self,
        device: &wgpu::Device,
        key: &KernelKey,
        target: Option<wgpu::TextureFormat>,
    ) -> Result<Arc<Pipeline>, KernelError> {
        self.asked += 1;
        let key = (key.clone(), target);
        if let Some((pipeline, last)) = self.known.get_mut(&key) {
            *last = self.asked;
            return Ok(pipeline.clone());
        }
        let pipeline = Arc::new(Pipeline::create(device, &key.0, target)?);
        self.keep(key, pipeline.clone());
        Ok(pipeline)
    }

    /// Takes in a compute kernel's pipeline that was made elsewhere.
    pub fn take_in(&mut self, key: KernelKey, pipeline: Arc<Pipeline>) {
        self.asked += 1;
        self.keep((key, None), pipeline);
    }

    fn keep(&mut self, key: CacheKey, pipeline: Arc<Pipeline>) {
        if self.known.len() >= MOST_KEPT
            && let Some(oldest) = self.known.iter().min_by_key(|(_, (_, last))| *last).map(|(key, _)| key.clone())
        {
            self.known.remove(&oldest);
        }
        self.known.insert(key, (pipeline, self.asked));
    }
}
