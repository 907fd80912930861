//! Work that gives way to the window: on a CPU adapter both want the same cores.

/// Lets all other threads of normal priority go before this one, and before those that it starts. Only on Linux, where threads
/// have priorities of their own and the common CPU adapter starts its threads from the one that makes its device.
#[cfg(target_os = "linux")]
pub fn give_way() {
    /// `PRIO_PROCESS`, which means one thread on Linux; 0 is the calling one.
    const THREAD: std::ffi::c_int = 0;
    #[expect(
        unsafe_code,
        reason = "a declaration of the C library's function, which takes three numbers and touches no memory"
    )]
    unsafe extern "C" {
        safe fn setpriority(which: std::ffi::c_int, who: std::ffi::c_uint, nice: std::ffi::c_int) -> std::ffi::c_int;
    }
    /// A thirtieth of the weight of a thread of normal priority.
    const NICE: std::ffi::c_int = 15;
    // Where it is not allowed, frames take longer.
    let _ = setpriority(THREAD, 0, NICE);
}

/// Elsewhere threads keep their priority.
#[cfg(not(target_os = "linux"))]
pub fn give_way() {}
