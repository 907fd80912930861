//! The layer's calls. It serves one instance with one session at a time, which is what the tests have.
#![expect(
    unsafe_code,
    reason = "an API layer is foreign functions; the loader keeps to the interface that it negotiates"
)]

use std::ffi::{CStr, c_char, c_void};
use std::sync::{Mutex, MutexGuard, PoisonError};

use openxr_sys as xr;
use xr::{Handle as _, pfn};

use crate::{DELAY_MS, TRACE};

/// A row of the recording.
#[derive(Clone, Copy)]
struct Row {
    time_ns: i64,
    /// LOCAL from gaze; `None` while the eye is closed.
    orientation: Option<xr::Quaternionf>,
}

#[derive(Default)]
struct Layer {
    next: Option<pfn::GetInstanceProcAddr>,
    instance: xr::Instance,
    action: Option<xr::Action>,
    gaze: Option<xr::Space>,
    local: Option<xr::Space>,
    /// The runtime's time of the first look.
    start: Option<xr::Time>,
    rows: Vec<Row>,
}

static LAYER: Mutex<Option<Layer>> = Mutex::new(None);

fn layer() -> MutexGuard<'static, Option<Layer>> {
    LAYER.lock().unwrap_or_else(PoisonError::into_inner)
}

fn rows() -> Vec<Row> {
    let path = std::env::var_os(TRACE).unwrap_or_default();
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let row = |line: &str| {
        let fields: Vec<f64> = line.split(',').filter_map(|field| field.trim().parse().ok()).collect();
        let [time, yaw, pitch, valid] = fields.try_into().ok()?;
        let orientation = (valid > 0.0).then(|| turned(yaw.to_radians(), pitch.to_radians()));
        Some(Row { time_ns: (time * 1e9) as i64, orientation })
    };
    text.lines().filter_map(row).collect()
}

/// Turns -Z by yaw to the right, then pitch up.
fn turned(yaw: f64, pitch: f64) -> xr::Quaternionf {
    let ((sy, cy), (sp, cp)) = ((-0.5 * yaw).sin_cos(), (0.5 * pitch).sin_cos());
    let [x, y, z, w] = [cy * sp, sy * cp, -sy * sp, cy * cp].map(|value| value as f32);
    xr::Quaternionf { x, y, z, w }
}

impl Layer {
    /// The newest row that has come out at a time, and its time.
    fn row(&mut self, now: xr::Time) -> Option<(Row, xr::Time)> {
        let start = *self.start.get_or_insert(now);
        let length = self.rows.last()?.time_ns + 1;
        let since = now.as_nanos() - start.as_nanos() - i64::from(DELAY_MS) * 1_000_000;
        if since < 0 {
            return None;
        }
        let (round, within) = (since / length, since % length);
        let row = self.rows.iter().rev().find(|row| row.time_ns <= within)?;
        Some((*row, xr::Time::from_nanos(start.as_nanos() + round * length + row.time_ns)))
    }

    /// The next layer's or the runtime's function of a name.
    fn next<F: Copy>(&self, name: &CStr) -> Option<F> {
        assert_eq!(size_of::<F>(), size_of::<pfn::VoidFunction>());
        let mut function = None;
        // SAFETY: the loader gave this function for this instance.
        let code = unsafe { self.next?(self.instance, name.as_ptr(), &mut function) };
        let function = function.filter(|_| code.into_raw() >= 0)?;
        // SAFETY: every caller names the type that OpenXR gives the function of this name.
        Some(unsafe { std::mem::transmute_copy::<pfn::VoidFunction, F>(&function) })
    }
}

/// Calls on to the next layer or the runtime, without holding the lock.
macro_rules! next {
    ($name:literal as $type:ty, $($argument:expr),*) => {{
        let function = layer().as_ref().and_then(|layer| layer.next::<$type>($name));
        match function {
            // SAFETY: the arguments are those that the program gave for this very function.
            Some(function) => unsafe { function($($argument),*) },
            None => xr::Result::ERROR_FUNCTION_UNSUPPORTED,
        }
    }};
}

unsafe extern "system" fn get_system_properties(
    instance: xr::Instance,
    system: xr::SystemId,
    properties: *mut xr::SystemProperties,
) -> xr::Result {
    let code = next!(c"xrGetSystemProperties" as pfn::GetSystemProperties, instance, system, properties);
    // SAFETY: the program gives a valid chain of structures, each of which begins with its type and the next one.
    unsafe {
        let mut link = (*properties).next.cast::<xr::BaseOutStructure>();
        while let Some(base) = link.as_mut() {
            if base.ty == xr::StructureType::SYSTEM_EYE_GAZE_INTERACTION_PROPERTIES_EXT {
                (*link.cast::<xr::SystemEyeGazeInteractionPropertiesEXT>()).supports_eye_gaze_interaction = xr::TRUE;
            }
            link = base.next;
        }
    }
    code
}

unsafe extern "system" fn suggest_bindings(
    instance: xr::Instance,
    suggested: *const xr::InteractionProfileSuggestedBinding,
) -> xr::Result {
    // SAFETY: the program gives a valid structure with as many bindings as it says.
    let (profile, first) = unsafe { ((*suggested).interaction_profile, (*suggested).suggested_bindings.as_ref()) };
    let mut text = [0 as c_char; 256];
    let mut length = 0;
    let code = next!(c"xrPathToString" as pfn::PathToString, instance, profile, 256, &mut length, text.as_mut_ptr());
    // SAFETY: the runtime ends the text with a zero, as the array that it was given does.
    let name = unsafe { CStr::from_ptr(text.as_ptr()) };
    if code.into_raw() >= 0 && name == c"/interaction_profiles/ext/eye_gaze_interaction" {
        if let (Some(layer), Some(binding)) = (layer().as_mut(), first) {
            layer.action = Some(binding.action);
        }
        return xr::Result::SUCCESS;
    }
    next!(c"xrSuggestInteractionProfileBindings" as pfn::SuggestInteractionProfileBindings, instance, suggested)
}

unsafe extern "system" fn create_action_space(
    session: xr::Session,
    info: *const xr::ActionSpaceCreateInfo,
    space: *mut xr::Space,
) -> xr::Result {
    let code = next!(c"xrCreateActionSpace" as pfn::CreateActionSpace, session, info, space);
    // SAFETY: the program gives a valid structure.
    let action = unsafe { (*info).action };
    if code.into_raw() < 0 || layer().as_ref().and_then(|layer| layer.action) != Some(action) {
        return code;
    }
    let pose = xr::Posef {
        orientation: xr::Quaternionf { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
        position: xr::Vector3f { x: 0.0, y: 0.0, z: 0.0 },
    };
    let info = xr::ReferenceSpaceCreateInfo {
        ty: xr::ReferenceSpaceCreateInfo::TYPE,
        next: std::ptr::null(),
        reference_space_type: xr::ReferenceSpaceType::LOCAL,
        pose_in_reference_space: pose,
    };
    let mut local = xr::Space::NULL;
    let code = next!(c"xrCreateReferenceSpace" as pfn::CreateReferenceSpace, session, &info, &mut local);
    if let Some(layer) = layer().as_mut() {
        // SAFETY: the runtime has just written the handle.
        layer.gaze = Some(unsafe { *space });
        (layer.local, layer.start) = (Some(local), None);
    }
    code
}

unsafe extern "system" fn get_action_state_pose(
    session: xr::Session,
    info: *const xr::ActionStateGetInfo,
    state: *mut xr::ActionStatePose,
) -> xr::Result {
    let code = next!(c"xrGetActionStatePose" as pfn::GetActionStatePose, session, info, state);
    // SAFETY: the program gives valid structures.
    unsafe {
        if layer().as_ref().and_then(|layer| layer.action) == Some((*info).action) {
            (*state).is_active = xr::TRUE;
        }
    }
    code
}

unsafe extern "system" fn locate_space(
    space: xr::Space,
    base: xr::Space,
    time: xr::Time,
    location: *mut xr::SpaceLocation,
) -> xr::Result {
    let (gaze, local) = match layer().as_ref() {
        Some(layer) => (layer.gaze, layer.local),
        None => (None, None),
    };
    let Some(local) = local.filter(|_| gaze == Some(space)) else {
        return next!(c"xrLocateSpace" as pfn::LocateSpace, space, base, time, location);
    };
    let sample = layer().as_mut().and_then(|layer| layer.row(time));
    // Where LOCAL is in the base space; the eye's chain is not the runtime's to fill.
    // SAFETY: the program gives a valid structure.
    let chain = unsafe { std::mem::replace(&mut (*location).next, std::ptr::null_mut()) };
    let code = next!(c"xrLocateSpace" as pfn::LocateSpace, local, base, time, location);
    // SAFETY: as above; the chain is the program's, each link of which begins with its type and the next one.
    unsafe {
        (*location).next = chain;
        match sample.and_then(|(row, _)| row.orientation) {
            Some(orientation) => (*location).pose.orientation = product((*location).pose.orientation, orientation),
            None => (*location).location_flags = xr::SpaceLocationFlags::EMPTY,
        }
        let mut link = chain.cast::<xr::BaseOutStructure>();
        while let Some(base) = link.as_mut() {
            if base.ty == xr::StructureType::EYE_GAZE_SAMPLE_TIME_EXT {
                let time = sample.map_or(xr::Time::from_nanos(0), |(_, time)| time);
                (*link.cast::<xr::EyeGazeSampleTimeEXT>()).time = time;
            }
            link = base.next;
        }
    }
    code
}

/// Hamilton's product.
fn product(a: xr::Quaternionf, b: xr::Quaternionf) -> xr::Quaternionf {
    xr::Quaternionf {
        x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    }
}

unsafe extern "system" fn get_instance_proc_addr(
    instance: xr::Instance,
    name: *const c_char,
    function: *mut Option<pfn::VoidFunction>,
) -> xr::Result {
    // SAFETY: the caller gives a text that ends with a zero.
    let name_text = unsafe { CStr::from_ptr(name) };
    let own: *const c_void = match name_text.to_bytes() {
        b"xrGetInstanceProcAddr" => get_instance_proc_addr as *const c_void,
        b"xrGetSystemProperties" => get_system_properties as *const c_void,
        b"xrSuggestInteractionProfileBindings" => suggest_bindings as *const c_void,
        b"xrCreateActionSpace" => create_action_space as *const c_void,
        b"xrGetActionStatePose" => get_action_state_pose as *const c_void,
        b"xrLocateSpace" => locate_space as *const c_void,
        _ => {
            let next = layer().as_ref().and_then(|layer| layer.next);
            return match next {
                // SAFETY: the arguments are the caller's.
                Some(next) => unsafe { next(instance, name, function) },
                None => xr::Result::ERROR_FUNCTION_UNSUPPORTED,
            };
        }
    };
    // SAFETY: the pointer is that of a function of OpenXR's calling convention; its caller casts it to its own type.
    unsafe { *function = Some(std::mem::transmute::<*const c_void, pfn::VoidFunction>(own)) };
    xr::Result::SUCCESS
}

unsafe extern "system" fn create_instance(
    info: *const xr::InstanceCreateInfo,
    layer_info: *const xr::ApiLayerCreateInfo,
    instance: *mut xr::Instance,
) -> xr::Result {
    // SAFETY: the loader gives its structure with a link for this layer, and wants the next layer to get the next link.
    unsafe {
        let Some(link) = (*layer_info).next_info.as_ref() else { return xr::Result::ERROR_INITIALIZATION_FAILED };
        let (Some(create), next) = (link.next_create_api_layer_instance, link.next_get_instance_proc_addr) else {
            return xr::Result::ERROR_INITIALIZATION_FAILED;
        };
        let info_of_next = xr::ApiLayerCreateInfo { next_info: link.next, ..*layer_info };
        let code = create(info, &info_of_next, instance);
        if code.into_raw() >= 0 {
            *layer() = Some(Layer { next, instance: *instance, rows: rows(), ..Layer::default() });
        }
        code
    }
}

/// The loader's first call.
///
/// # Safety
/// The loader calls it with structures of the interface's first version.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn xrNegotiateLoaderApiLayerInterface(
    loader_info: *const xr::NegotiateLoaderInfo,
    _name: *const c_char,
    request: *mut xr::NegotiateApiLayerRequest,
) -> xr::Result {
    // SAFETY: the loader gives valid structures.
    unsafe {
        (*request).layer_interface_version = 1;
        (*request).layer_api_version = (*loader_info).max_api_version.min(xr::Version::new(1, 0, u32::MAX));
        (*request).get_instance_proc_addr = Some(get_instance_proc_addr);
        (*request).create_api_layer_instance = Some(create_instance);
    }
    xr::Result::SUCCESS
}
