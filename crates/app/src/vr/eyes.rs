//! The two pictures of a headset: their swapchains, and what each eye sees.

use glam::Quat;
use openxr as xr;
use tracer::gpu::Gpu;
use tracer::panorama::Frustum;

use super::device;
use super::error::VrError;

/// Pixel formats that are drawn, best first: Vulkan's code and wgpu's name.
const FORMATS: [(u32, wgpu::TextureFormat); 4] = [
    (43, wgpu::TextureFormat::Rgba8UnormSrgb),
    (50, wgpu::TextureFormat::Bgra8UnormSrgb),
    (37, wgpu::TextureFormat::Rgba8Unorm),
    (44, wgpu::TextureFormat::Bgra8Unorm),
];

/// One eye's picture.
pub(super) struct Eye {
    // Before the swapchain, which must be destroyed last.
    images: Vec<wgpu::TextureView>,
    pub swapchain: xr::Swapchain<xr::Vulkan>,
    pub size: [u32; 2],
}

/// What one eye sees of the frame that is being drawn.
#[derive(Clone, Copy, Debug)]
pub struct EyeView {
    /// LOCAL from eye.
    pub local_from_eye: Quat,
    /// What it spans.
    pub frustum: Frustum,
}

/// One eye's picture in a frame.
#[derive(Clone, Copy, Debug)]
pub struct EyePicture<'a> {
    /// What is to be seen in it.
    pub view: EyeView,
    /// Where it is to be drawn.
    pub target: &'a wgpu::TextureView,
    /// Format of the target.
    pub format: wgpu::TextureFormat,
    /// Pixels of the target.
    pub size: [u32; 2],
}

impl EyeView {
    /// From a runtime's view; `None` when its orientation or its angles mean nothing.
    pub fn new(view: &xr::View) -> Option<Self> {
        let local_from_eye = orientation(view.pose.orientation)?;
        let fov = view.fov;
        let tangents = [fov.angle_left, fov.angle_right, fov.angle_down, fov.angle_up].map(f32::tan);
        let [left, right, down, up] = tangents;
        let is_sound = tangents.iter().all(|tangent| tangent.is_finite()) && left < right && down < up;
        is_sound.then_some(Self { local_from_eye, frustum: Frustum { left, right, down, up } })
    }
}

/// A runtime's quaternion, if it is one.
pub fn orientation(q: xr::Quaternionf) -> Option<Quat> {
    let q = Quat::from_xyzw(q.x, q.y, q.z, q.w);
    (q.is_finite() && q.length_squared() > 0.25).then(|| q.normalize())
}

/// The format in which pictures are drawn: the best of those that the runtime takes.
pub(super) fn choose_format(session: &xr::Session<xr::Vulkan>) -> Result<(u32, wgpu::TextureFormat), VrError> {
    let taken = session.enumerate_swapchain_formats().map_err(VrError::call("xrEnumerateSwapchainFormats"))?;
    FORMATS.into_iter().find(|(code, _)| taken.contains(code)).ok_or(VrError::NoFormat)
}

impl Eye {
    /// A picture of so many pixels.
    pub fn new(
        gpu: &Gpu,
        session: &xr::Session<xr::Vulkan>,
        (code, format): (u32, wgpu::TextureFormat),
        size: [u32; 2],
    ) -> Result<Self, VrError> {
        let swapchain = session
            .create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags: xr::SwapchainUsageFlags::COLOR_ATTACHMENT | xr::SwapchainUsageFlags::SAMPLED,
                format: code,
                sample_count: 1,
                width: size[0],
                height: size[1],
                face_count: 1,
                array_size: 1,
                mip_count: 1,
            })
            .map_err(VrError::call("xrCreateSwapchain"))?;
        let images = swapchain
            .enumerate_images()
            .map_err(VrError::call("xrEnumerateSwapchainImages"))?
            .into_iter()
            .map(|image| {
                let texture = device::texture(gpu, image, format, size)?;
                Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
            })
            .collect::<Result<_, VrError>>()?;
        Ok(Self { images, swapchain, size })
    }

    /// The image to draw next, once the compositor is done with it.
    pub fn acquire(&mut self) -> Result<usize, VrError> {
        let index = self.swapchain.acquire_image().map_err(VrError::call("xrAcquireSwapchainImage"))?;
        self.swapchain.wait_image(xr::Duration::INFINITE).map_err(VrError::call("xrWaitSwapchainImage"))?;
        Ok(index as usize)
    }

    /// An image by its index.
    pub fn image(&self, index: usize) -> Option<&wgpu::TextureView> {
        self.images.get(index)
    }

    /// Hands the image over.
    pub fn release(&mut self) -> Result<(), VrError> {
        self.swapchain.release_image().map_err(VrError::call("xrReleaseSwapchainImage"))
    }

    /// All of it.
    pub fn rect(&self) -> xr::Rect2Di {
        let [width, height] = self.size.map(|side| side as i32);
        xr::Rect2Di { offset: xr::Offset2Di { x: 0, y: 0 }, extent: xr::Extent2Di { width, height } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_runtimes_view_becomes_tangents_and_nonsense_is_refused() {
        let fov = xr::Fovf { angle_left: -0.8, angle_right: 0.7, angle_up: 0.6, angle_down: -0.9 };
        let view = xr::View { pose: xr::Posef::IDENTITY, fov };
        let found = EyeView::new(&view).map(|eye| eye.frustum);
        let expected =
            Frustum { left: (-0.8_f32).tan(), right: 0.7_f32.tan(), down: (-0.9_f32).tan(), up: 0.6_f32.tan() };
        assert_eq!(found, Some(expected));
        assert!(EyeView::new(&xr::View::default()).is_none(), "a zero quaternion and no angles");
        let inverted = xr::Fovf { angle_left: 0.7, angle_right: -0.8, ..fov };
        assert!(EyeView::new(&xr::View { fov: inverted, ..view }).is_none());
        let lost = xr::Quaternionf { x: f32::NAN, ..xr::Quaternionf::default() };
        assert!(orientation(lost).is_none());
    }
}
