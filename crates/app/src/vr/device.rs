//! The graphics device that a runtime asks for, and its images as textures.
//!
//! The order of calls is that of XR_KHR_vulkan_enable2: requirements, Vulkan instance, physical device, device; wgpu adopts
//! each of them.
#![expect(unsafe_code, reason = "foreign handles; each block says why it is sound")]

use ash::vk::{self, Handle};
use openxr as xr;
use openxr::sys::platform::VkGetInstanceProcAddr;
use tracer::gpu::Gpu;
use wgpu::hal::{self, api::Vulkan};

use super::error::VrError;
use super::runtime::Runtime;

/// The version that is asked for: below it, SPIR-V as wgpu writes it is not valid.
const VULKAN: u32 = vk::API_VERSION_1_3;

/// A device with what a session wants to know of it.
pub struct HeadsetDevice {
    pub gpu: Gpu,
    binding: xr::vulkan::SessionCreateInfo,
}

fn failed(cause: impl std::fmt::Display) -> VrError {
    VrError::Device(cause.to_string())
}

fn version(raw: u32) -> String {
    format!("{}.{}", vk::api_version_major(raw), vk::api_version_minor(raw))
}

/// Makes the device that the runtime asks for.
pub fn open(runtime: &Runtime) -> Result<HeadsetDevice, VrError> {
    let (xr_instance, system) = (&runtime.instance, runtime.system);
    // Mandatory before a session, whatever comes of it.
    let requirements = xr_instance
        .graphics_requirements::<xr::Vulkan>(system)
        .map_err(VrError::call("xrGetVulkanGraphicsRequirements2KHR"))?;
    // SAFETY: a library of the loader's name is taken to be Vulkan's loader, as wgpu does.
    let entry = unsafe { ash::Entry::load() }.map_err(failed)?;
    // SAFETY: the entry is a loaded Vulkan loader.
    let loader = unsafe { entry.try_enumerate_instance_version() }.map_err(failed)?.unwrap_or(vk::API_VERSION_1_0);
    let api = VULKAN.min(loader);
    let least = requirements.min_api_version_supported;
    if xr::Version::new(vk::api_version_major(api) as u16, vk::api_version_minor(api) as u16, 0) < least {
        let wanted = format!("{}.{}", least.major(), least.minor());
        return Err(VrError::VulkanVersion { runtime: runtime.facts().runtime.clone(), wanted, found: version(api) });
    }
    // SAFETY: `vkGetInstanceProcAddr` has the same signature whichever crate declares it; the pointer stays valid as long
    // as the entry, which wgpu's instance keeps.
    let get_proc = unsafe {
        std::mem::transmute::<vk::PFN_vkGetInstanceProcAddr, VkGetInstanceProcAddr>(
            entry.static_fn().get_instance_proc_addr,
        )
    };

    let flags = wgpu::InstanceFlags::empty();
    let extensions = hal::vulkan::Instance::desired_extensions(&entry, api, flags).map_err(failed)?;
    let extension_names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let application =
        vk::ApplicationInfo::default().application_name(c"Fovea").engine_name(c"wgpu-hal").api_version(api);
    let info =
        vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&extension_names);
    // SAFETY: the structure and all that it points to outlive the call.
    let instance = unsafe { xr_instance.create_vulkan_instance(system, get_proc, (&raw const info).cast()) }
        .map_err(VrError::call("xrCreateVulkanInstanceKHR"))?
        .map_err(|code| failed(vk::Result::from_raw(code)))?;
    // SAFETY: the runtime has just made this instance with this entry's loader.
    let instance = unsafe { ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(instance as u64)) };
    let raw_instance = instance.handle();
    // SAFETY: the instance was made by xrCreateVulkanInstanceKHR for this system.
    let physical = unsafe { xr_instance.vulkan_graphics_device(system, raw_instance.as_raw() as _) }
        .map_err(VrError::call("xrGetVulkanGraphicsDevice2KHR"))?;
    let physical = vk::PhysicalDevice::from_raw(physical as u64);
    // SAFETY: the physical device is one of this instance's.
    let family = unsafe { instance.get_physical_device_queue_family_properties(physical) }
        .iter()
        .position(|family| family.queue_flags.contains(vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE))
        .ok_or_else(|| failed("no queue both draws and computes"))? as u32;
    // SAFETY: the instance was made with this entry, version and extensions; wgpu owns it from now on.
    let hal_instance = unsafe {
        let thresholds = wgpu::MemoryBudgetThresholds::default();
        hal::vulkan::Instance::from_raw(entry, instance, api, 0, None, extensions, flags, thresholds, false, None)
    }
    .map_err(failed)?;
    let exposed = hal_instance.expose_adapter(physical).ok_or_else(|| failed("wgpu cannot use the adapter"))?;

    // SAFETY: the instance is alive, and wgpu owns it from now on.
    let wgpu_instance = unsafe { wgpu::Instance::from_hal::<Vulkan>(hal_instance) };
    // SAFETY: the adapter was exposed by this instance.
    let adapter = unsafe { wgpu_instance.create_adapter_from_hal::<Vulkan>(exposed) };
    let (features, limits) = Gpu::requirements(&adapter);
    // SAFETY: the handle is only read, and destroyed by nobody.
    let hal_adapter = unsafe { adapter.as_hal::<Vulkan>() }.ok_or_else(|| failed("the adapter is none of Vulkan's"))?;
    let extensions = hal_adapter.required_device_extensions(features);
    let extension_names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let mut enabled = hal_adapter.physical_device_features(&extensions, features);
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
    let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extension_names);
    let info = enabled.add_to_device_create(info);
    // SAFETY: the structure and all that it points to outlive the call; the physical device is the runtime's choice.
    let device =
        unsafe { xr_instance.create_vulkan_device(system, get_proc, physical.as_raw() as _, (&raw const info).cast()) }
            .map_err(VrError::call("xrCreateVulkanDeviceKHR"))?
            .map_err(|code| failed(vk::Result::from_raw(code)))?;
    let raw_device = vk::Device::from_raw(device as u64);
    // SAFETY: the device was made from this adapter with these extensions and features, and with one queue of this
    // family; wgpu owns it from now on.
    let opened = unsafe {
        let device = ash::Device::load(hal_adapter.shared_instance().raw_instance().fp_v1_0(), raw_device);
        let hints = tracer::gpu::MEMORY;
        hal_adapter.device_from_raw(device, None, &extensions, features, &limits, &hints, family, 0)
    }
    .map_err(failed)?;
    drop(hal_adapter);
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("headset"),
        required_features: features,
        required_limits: limits,
        ..Default::default()
    };
    // SAFETY: the device was opened on this adapter with these features.
    let (device, queue) = unsafe { adapter.create_device_from_hal::<Vulkan>(opened, &descriptor) }.map_err(failed)?;
    let binding = xr::vulkan::SessionCreateInfo {
        instance: raw_instance.as_raw() as _,
        physical_device: physical.as_raw() as _,
        device: raw_device.as_raw() as _,
        queue_family_index: family,
        queue_index: 0,
    };
    Ok(HeadsetDevice { gpu: Gpu::adopt(adapter, device, queue)?, binding })
}

/// A session with what waits for its frames and what hands them over.
pub type Session = (xr::Session<xr::Vulkan>, xr::FrameWaiter, xr::FrameStream<xr::Vulkan>);

/// Makes a session on the device, which the session keeps alive.
pub fn session(runtime: &Runtime, device: &HeadsetDevice) -> Result<Session, VrError> {
    // SAFETY: the handles are those of the device that the runtime asked for, which the guard keeps until the session is
    // destroyed. Frames and images are handed over by the thread that submits to the queue.
    unsafe {
        runtime.instance.create_session_with_guard::<xr::Vulkan>(
            runtime.system,
            &device.binding,
            Box::new(device.gpu.clone()),
        )
    }
    .map_err(VrError::call("xrCreateSession"))
}

/// An image of a swapchain as a texture that can be drawn to. The swapchain must outlive the texture and what draws to it.
pub fn texture(gpu: &Gpu, image: u64, format: wgpu::TextureFormat, size: [u32; 2]) -> Result<wgpu::Texture, VrError> {
    let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
    let hal_descriptor = hal::TextureDescriptor {
        label: Some("eye"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUses::COLOR_TARGET,
        memory_flags: hal::MemoryFlags::empty(),
        view_formats: vec![],
    };
    let descriptor = wgpu::TextureDescriptor {
        label: Some("eye"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    };
    // SAFETY: the image is one of a swapchain that was made with this format, size and usage on this device. The empty
    // callback leaves it to the runtime to destroy it. The runtime hands images over as colour attachments.
    unsafe {
        let device = gpu.device.as_hal::<Vulkan>().ok_or_else(|| failed("it is none of Vulkan's"))?;
        let hal_texture = device.texture_from_raw(
            vk::Image::from_raw(image),
            &hal_descriptor,
            Some(Box::new(|| {})),
            hal::vulkan::TextureMemory::External,
        );
        drop(device);
        Ok(gpu.device.create_texture_from_hal::<Vulkan>(hal_texture, &descriptor, wgpu::TextureUses::COLOR_TARGET))
    }
}
