//! Buttons of controllers, and the gaze of the eyes, as OpenXR's actions.

use glam::Quat;
use openxr as xr;

use super::calls;
use super::error::VrError;
use super::eyes::orientation;
use super::runtime::Runtime;

/// What somebody asked for with a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Press {
    /// The next mode.
    NextMode,
    /// An empty film.
    Restart,
    /// The marker of the fovea, on or off.
    Marker,
}

/// The actions of a session.
pub(super) struct Input {
    set: xr::ActionSet,
    buttons: [(xr::Action<bool>, Press); 3],
    gaze: Option<(xr::Action<xr::Posef>, xr::Space)>,
}

/// Where an eye looks, as the runtime says it.
#[derive(Clone, Copy, Debug)]
pub struct GazeReading {
    /// LOCAL from gaze: the eye looks along -Z.
    pub local_from_gaze: Quat,
    /// When the eye was there, by the runtime's clock; `None` when it does not know.
    pub sampled: Option<xr::Time>,
}

impl Input {
    /// Declares the actions and binds them.
    pub fn new(runtime: &Runtime, session: &xr::Session<xr::Vulkan>) -> Result<Self, VrError> {
        let instance = &runtime.instance;
        let path = |text: &str| instance.string_to_path(text).map_err(VrError::call("xrStringToPath"));
        let set = instance.create_action_set("preview", "Preview", 0).map_err(VrError::call("xrCreateActionSet"))?;
        let button = |name: &str, words: &str, press| {
            let action = set.create_action::<bool>(name, words, &[]).map_err(VrError::call("xrCreateAction"))?;
            Ok::<_, VrError>((action, press))
        };
        let buttons = [
            button("next_mode", "Next sampling mode", Press::NextMode)?,
            button("restart", "Start the picture again", Press::Restart)?,
            button("marker", "Mark where the picture is sharp", Press::Marker)?,
        ];
        // Every runtime maps its controllers to the simple one.
        let bindings = [
            xr::Binding::new(&buttons[0].0, path("/user/hand/right/input/select/click")?),
            xr::Binding::new(&buttons[1].0, path("/user/hand/left/input/select/click")?),
            xr::Binding::new(&buttons[2].0, path("/user/hand/right/input/menu/click")?),
            xr::Binding::new(&buttons[2].0, path("/user/hand/left/input/menu/click")?),
        ];
        let suggest = |profile: &str, bindings: &[xr::Binding<'_>]| {
            instance
                .suggest_interaction_profile_bindings(path(profile)?, bindings)
                .map_err(VrError::call("xrSuggestInteractionProfileBindings"))
        };
        suggest("/interaction_profiles/khr/simple_controller", &bindings)?;
        let gaze = if runtime.facts().eye_gaze {
            let action =
                set.create_action::<xr::Posef>("gaze", "Gaze", &[]).map_err(VrError::call("xrCreateAction"))?;
            let binding = xr::Binding::new(&action, path("/user/eyes_ext/input/gaze_ext/pose")?);
            suggest("/interaction_profiles/ext/eye_gaze_interaction", &[binding])?;
            Some(action)
        } else {
            None
        };
        session.attach_action_sets(&[&set]).map_err(VrError::call("xrAttachSessionActionSets"))?;
        let gaze = gaze
            .map(|action| {
                let space = action
                    .create_space(session, xr::Path::NULL, xr::Posef::IDENTITY)
                    .map_err(VrError::call("xrCreateActionSpace"))?;
                Ok::<_, VrError>((action, space))
            })
            .transpose()?;
        Ok(Self { set, buttons, gaze })
    }

    /// Asks for the newest states, and says what was pressed since the last call. Only a focused session has input.
    pub fn sync(&self, session: &xr::Session<xr::Vulkan>) -> Result<Vec<Press>, VrError> {
        session.sync_actions(&[xr::ActiveActionSet::new(&self.set)]).map_err(VrError::call("xrSyncActions"))?;
        let mut presses = Vec::new();
        for (action, press) in &self.buttons {
            let state = action.state(session, xr::Path::NULL).map_err(VrError::call("xrGetActionStateBoolean"))?;
            if state.is_active && state.changed_since_last_sync && state.current_state {
                presses.push(*press);
            }
        }
        Ok(presses)
    }

    /// Where the eye looks; `None` while the headset cannot tell (a blink, no permission, no calibration).
    pub fn gaze(
        &self,
        runtime: &Runtime,
        session: &xr::Session<xr::Vulkan>,
        local: &xr::Space,
        time: xr::Time,
    ) -> Result<Option<GazeReading>, VrError> {
        let Some((action, space)) = &self.gaze else { return Ok(None) };
        if !action.is_active(session, xr::Path::NULL).map_err(VrError::call("xrGetActionStatePose"))? {
            return Ok(None);
        }
        let located = calls::locate_gaze(&runtime.instance, space, local, time)?;
        let valid = located.is_valid.then_some(located.pose.orientation).and_then(orientation);
        Ok(valid.map(|local_from_gaze| GazeReading { local_from_gaze, sampled: located.sampled }))
    }
}
