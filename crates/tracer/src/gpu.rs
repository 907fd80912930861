//! The device: found by the tracer when headless, handed over by whoever has a window or headset otherwise.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use thiserror::Error;

/// Why no device could be had.
#[derive(Debug, Error)]
pub enum GpuError {
    /// Nothing that can compute.
    #[error("no graphics adapter found: install a Vulkan driver (on Debian or Ubuntu: mesa-vulkan-drivers)")]
    NoAdapter,
    /// `WGPU_ADAPTER_NAME` or a name asked for matches nothing.
    #[error("no graphics adapter's name contains '{wanted}'; there are: {found}")]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of what is there.
        found: String,
    },
    /// The adapter lacks what the tracer cannot do without.
    #[error("adapter {adapter} cannot run the tracer: {shortfalls}")]
    Unfit {
        /// Its name.
        adapter: String,
        /// Every shortfall.
        shortfalls: String,
    },
    /// The driver refused.
    #[error("adapter {adapter} gave no device: {cause}")]
    Device {
        /// Its name.
        adapter: String,
        /// The driver's words.
        cause: String,
    },
}

/// Which adapter to take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AdapterSelect {
    /// `WGPU_ADAPTER_NAME` if set, else a GPU, else a software adapter. `WGPU_BACKEND` restricts the backends.
    #[default]
    Auto,
    /// The first whose name contains this, upper and lower case alike.
    Named(String),
}

/// An adapter as [`Gpu::adapters`] lists it.
#[derive(Clone, Debug)]
pub struct AdapterDescription {
    /// What wgpu says of it.
    pub info: wgpu::AdapterInfo,
    /// What it lacks; empty when the tracer runs on it.
    pub shortfalls: Vec<String>,
    /// True for the one that [`AdapterSelect::Auto`] takes.
    pub is_default: bool,
}

/// Where the geometry's tables are on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GeometryPlace {
    /// In storage buffers, except where one would be larger than the adapter binds, or where the driver reads textures faster.
    #[default]
    Auto,
    /// In storage buffers; a table that is larger than the adapter binds is an error.
    Buffers,
    /// In texture pages.
    Textures,
}

/// A device and its queue, ready for the tracer. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The adapter.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// The queue.
    pub queue: wgpu::Queue,
    info: Arc<wgpu::AdapterInfo>,
    lost: Arc<AtomicBool>,
    geometry: GeometryPlace,
}

/// The device stopped answering: its driver was reset, or it was destroyed. Another one must be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the graphics device was lost")]
pub struct DeviceLost;

/// Storage buffers that the largest kernel binds in one stage.
const STORAGE_BUFFERS: u32 = 10;
/// Smallest storage binding that the tracer works with: wgpu's default.
const SMALLEST_BINDING: u64 = 128 << 20;

/// How a device should allocate: in small blocks, which go back to the system when they are empty. Scenes come and go, little is
/// allocated for a frame, and on a CPU adapter all of it is the machine's own memory.
pub const MEMORY: wgpu::MemoryHints = wgpu::MemoryHints::MemoryUsage;

impl Gpu {
    /// Opens a device without a window.
    ///
    /// # Errors
    /// When there is no adapter, none by that name, or it cannot run the tracer.
    pub fn headless(select: &AdapterSelect) -> Result<Self, GpuError> {
        let adapters = usable_adapters();
        Self::open(Self::choose(&adapters, select)?.clone())
    }

    /// Another device of the same adapter.
    ///
    /// # Errors
    /// When the adapter gives no more.
    pub fn another(&self) -> Result<Self, GpuError> {
        Ok(Self { geometry: self.geometry, ..Self::open(self.adapter.clone())? })
    }

    fn open(adapter: wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let (required_features, required_limits) = Self::requirements(&adapter);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("fovea"),
            required_features,
            required_limits,
            memory_hints: MEMORY,
            ..Default::default()
        }))
        .map_err(|error| GpuError::Device { adapter: info.name.clone(), cause: error.to_string() })?;
        Self::adopt(adapter, device, queue)
    }

    /// Takes over a device that somebody else made, ideally by [`Gpu::requirements`].
    ///
    /// # Errors
    /// [`GpuError::Unfit`] names every shortfall of the device.
    pub fn adopt(adapter: wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let shortfalls = shortfalls(&device.limits());
        if shortfalls.is_empty() {
            let lost = Arc::new(AtomicBool::new(false));
            watch(&device, &lost);
            Ok(Self { adapter, device, queue, info: Arc::new(info), lost, geometry: GeometryPlace::default() })
        } else {
            Err(GpuError::Unfit { adapter: info.name, shortfalls: shortfalls.join("; ") })
        }
    }

    /// Features and limits to ask a device for: what the tracer uses where this adapter has it.
    pub fn requirements(adapter: &wgpu::Adapter) -> (wgpu::Features, wgpu::Limits) {
        let wanted = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::PIPELINE_CACHE;
        (adapter.features() & wanted, adapter.limits())
    }

    /// Every adapter that wgpu finds.
    pub fn adapters() -> Vec<AdapterDescription> {
        let adapters = usable_adapters();
        let default = Self::choose(&adapters, &AdapterSelect::Auto).ok().map(wgpu::Adapter::get_info);
        let mut default_seen = false;
        adapters
            .iter()
            .map(|adapter| {
                let info = adapter.get_info();
                let is_default = !default_seen && default.as_ref() == Some(&info);
                default_seen |= is_default;
                AdapterDescription { shortfalls: shortfalls(&adapter.limits()), is_default, info }
            })
            .collect()
    }

    /// Which of these adapters to take.
    ///
    /// # Errors
    /// When there is none, or none by that name.
    pub fn choose<'a>(adapters: &'a [wgpu::Adapter], select: &AdapterSelect) -> Result<&'a wgpu::Adapter, GpuError> {
        let wanted = match select {
            AdapterSelect::Auto => std::env::var("WGPU_ADAPTER_NAME").ok(),
            AdapterSelect::Named(name) => Some(name.clone()),
        };
        if let Some(wanted) = wanted {
            let lower = wanted.to_lowercase();
            return adapters.iter().find(|a| a.get_info().name.to_lowercase().contains(&lower)).ok_or_else(|| {
                let found = adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
                GpuError::NoSuchAdapter { wanted, found: if found.is_empty() { "none".into() } else { found } }
            });
        }
        let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        adapters.iter().min_by_key(|adapter| rank(adapter)).ok_or(GpuError::NoAdapter)
    }

    /// Name, driver and kind of the adapter.
    pub fn info(&self) -> &wgpu::AdapterInfo {
        &self.info
    }

    /// True when the adapter is a program on the CPU (lavapipe, SwiftShader, WARP).
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Waits until everything submitted so far is done.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn wait(&self) -> Result<(), DeviceLost> {
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        if polled.is_err() || self.is_lost() { Err(DeviceLost) } else { Ok(()) }
    }

    /// Whether the device was lost. Everything on it is gone; what is asked of it does nothing or is an error.
    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Acquire)
    }

    /// Destroys the device, as a driver that is reset would: how recovery is tested.
    pub fn lose(&self) {
        self.lost.store(true, Ordering::Release);
        self.device.destroy();
    }

    /// A buffer with contents, of which there must be some. On a lost device it is a dead one.
    pub(crate) fn buffer(&self, label: &str, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.buffer_with_room(label, contents, contents.len() as u64, usage)
    }

    /// A buffer that begins with contents, with zeros up to `size` bytes.
    pub(crate) fn buffer_with_room(
        &self,
        label: &str,
        contents: &[u8],
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
            usage,
            mapped_at_creation: true,
        });
        // wgpu's own way to do this panics when the device is lost.
        if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
            mapped.slice(..contents.len()).copy_from_slice(contents);
        }
        buffer.unmap();
        buffer
    }

    /// This device with the geometry of scenes that are set from now on elsewhere: for tests and comparisons.
    #[must_use]
    pub fn with_geometry_in(self, geometry: GeometryPlace) -> Self {
        Self { geometry, ..self }
    }

    /// Whether geometry whose tables have these sizes in bytes is to be in storage buffers.
    pub(crate) fn keeps_in_buffers(&self, tables: [u64; 4]) -> bool {
        match self.geometry {
            // lavapipe reads words of storage buffers one by one with a comparison for each, texels whole.
            GeometryPlace::Auto => tables.iter().all(|&bytes| bytes <= self.largest_binding()) && !self.is_lavapipe(),
            GeometryPlace::Buffers => true,
            GeometryPlace::Textures => false,
        }
    }

    fn is_lavapipe(&self) -> bool {
        self.info.driver == "llvmpipe"
    }

    /// Whether each of the adapter's threads takes one run of a dispatch's workgroups: lavapipe divides them beforehand.
    pub(crate) fn takes_runs_of_workgroups(&self) -> bool {
        self.is_lavapipe()
    }

    /// Whether this is lavapipe of Mesa 22, where much measures otherwise than in later ones.
    pub(crate) fn is_lavapipe_22(&self) -> bool {
        self.is_lavapipe() && self.info.driver_info.starts_with("Mesa 22.")
    }

    /// Bytes of memory that are free for buffers and textures, where that can be known: on a software adapter under Linux, whose
    /// memory is the machine's. The system would not refuse more, but end the program later.
    pub fn free_memory(&self) -> Option<u64> {
        if !self.is_software() {
            return None;
        }
        // See proc_meminfo(5); the unit is 1024 bytes.
        let table = std::fs::read_to_string("/proc/meminfo").ok()?;
        let row = table.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        row.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes << 10)
    }

    /// Whether so many bytes more are surely too much for the device.
    pub(crate) fn lacks_memory(&self, bytes: u64) -> bool {
        self.free_memory().is_some_and(|free| bytes > free)
    }

    /// Bytes that one storage binding may have.
    pub fn largest_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }
}

/// What the device complains of on this thread while this lives, for a caller who answers for it.
#[derive(Debug)]
pub(crate) struct Complaints {
    // Scopes end in the reverse of the order in which they began, also where a caller returns early.
    memory: wgpu::ErrorScopeGuard,
    internal: wgpu::ErrorScopeGuard,
    validation: wgpu::ErrorScopeGuard,
}

impl Complaints {
    pub fn of(device: &wgpu::Device) -> Self {
        let validation = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let internal = device.push_error_scope(wgpu::ErrorFilter::Internal);
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        Self { memory, internal, validation }
    }

    /// The cause of what there was: use of what memory lacked is refused after that, which is a consequence.
    pub fn end(self) -> Option<wgpu::Error> {
        let Self { memory, internal, validation } = self;
        let errors = [memory.pop(), internal.pop(), validation.pop()].map(pollster::block_on);
        errors.into_iter().flatten().next()
    }
}

/// What is known of free memory, as the end of an error's sentence.
pub(crate) fn free_text(free: &Option<u64>) -> String {
    free.map_or_else(String::new, |bytes| format!("; {bytes} bytes are free"))
}

/// Notes when the device is lost. What wgpu complains of afterwards is a consequence; before, it is a fault of ours.
fn watch(device: &wgpu::Device, lost: &Arc<AtomicBool>) {
    /// Another thread may hear of the loss first.
    const GRACE: Duration = Duration::from_millis(100);
    let noted = Arc::clone(lost);
    device.set_device_lost_callback(move |_, _| noted.store(true, Ordering::Release));
    let known = Arc::clone(lost);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        if !known.load(Ordering::Acquire) {
            std::thread::sleep(GRACE);
            assert!(known.load(Ordering::Acquire), "wgpu: {error}");
        }
    }));
}

fn usable_adapters() -> Vec<wgpu::Adapter> {
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle().with_env();
    let backends = descriptor.backends & (wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12);
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
}

fn shortfalls(limits: &wgpu::Limits) -> Vec<String> {
    let mut list = Vec::new();
    if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
        list.push(format!(
            "{} storage buffers a stage, {STORAGE_BUFFERS} are needed",
            limits.max_storage_buffers_per_shader_stage
        ));
    }
    if limits.max_storage_buffer_binding_size < SMALLEST_BINDING {
        list.push(format!(
            "storage bindings of at most {} bytes, {SMALLEST_BINDING} are needed",
            limits.max_storage_buffer_binding_size
        ));
    }
    if limits.max_compute_invocations_per_workgroup < 64 {
        list.push("fewer than 64 compute invocations a workgroup".into());
    }
    list
}
