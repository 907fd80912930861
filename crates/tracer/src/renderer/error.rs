//! Why the renderer cannot go on.

use thiserror::Error;

use crate::{film::ReadError, gpu::free_text, kernels::pipelines::KernelError, upload::UploadError};

/// Why the renderer cannot go on.
#[derive(Debug, Error)]
pub enum RenderError {
    /// A scene does not fit the adapter.
    #[error(transparent)]
    Upload(#[from] UploadError),
    /// A kernel does not compile.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// A buffer could not be read back.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The film is larger than the device's memory.
    #[error(
        "a film of {width}x{height} pixels needs {bytes} bytes, more than adapter {adapter} can give{}",
        free_text(free)
    )]
    FilmTooLarge {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// What it needs.
        bytes: u64,
        /// Its name.
        adapter: String,
        /// Bytes of memory that are free, where that is known.
        free: Option<u64>,
    },
    /// A film without pixels, or whose image plane has no extent: an angle of view that is not between 0 and pi.
    #[error("a film of {width}x{height} pixels and half extents {half_extent:?} is no picture")]
    NoPicture {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Of the image plane at distance 1; 1 for a panorama.
        half_extent: [f32; 2],
    },
    /// A view has more pixels than the device can bind at once.
    #[error("a view of {width}x{height} pixels binds {bytes} bytes, and adapter {adapter} at most {limit}")]
    ViewTooLarge {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Of one binding.
        bytes: u64,
        /// What the adapter allows.
        limit: u64,
        /// Its name.
        adapter: String,
    },
    /// A distribution over a list of film pixels has more of them than random numbers tell apart.
    #[error(
        "samples cannot be spread over a list of {pixels} film pixels, {limit} is the most: choose a smaller part of the film"
    )]
    PixelListTooLong {
        /// Of the list.
        pixels: u64,
        /// The longest list.
        limit: u64,
    },
    /// A distribution's lists of film pixels are more than the device can bind at once.
    #[error("lists of film pixels bind {bytes} bytes, and adapter {adapter} at most {limit}")]
    PixelListsTooLarge {
        /// Of all lists.
        bytes: u64,
        /// What the adapter allows.
        limit: u64,
        /// Its name.
        adapter: String,
    },
    /// Tracing was asked for before a scene was set.
    #[error("no scene to trace")]
    NoScene,
    /// The device stopped answering.
    #[error("the graphics device was lost")]
    DeviceLost,
}
