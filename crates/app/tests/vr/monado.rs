//! A running Monado with a simulated headset, and programs that find it.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Two compositors on one CPU adapter would measure each other.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
static FOLDERS: AtomicU32 = AtomicU32::new(0);

/// Where `scripts/monado` has put it; says that the test did not run when it has not.
pub fn folder(test: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("FOVEA_MONADO") else {
        eprintln!("SKIP {test}: FOVEA_MONADO is not set");
        return None;
    };
    let folder = PathBuf::from(folder);
    assert!(folder.join("run").exists(), "FOVEA_MONADO is set, but {} has no Monado", folder.display());
    Some(folder)
}

/// Monado's folder with a place for sockets and logs; the service runs between `start` and `stop`.
pub struct Monado {
    folder: PathBuf,
    place: PathBuf,
    service: Option<Child>,
    _alone: MutexGuard<'static, ()>,
}

impl Monado {
    /// Nothing runs yet. `None`, with the reason, where Monado is not to be had.
    pub fn find(test: &str) -> Option<Self> {
        let folder = folder(test)?;
        let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
        // Short: the path of a socket has 107 bytes.
        let place = std::env::temp_dir().join(format!("fovea-vr-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&place).unwrap();
        std::fs::set_permissions(&place, std::fs::Permissions::from_mode(0o700)).unwrap();
        Some(Self { folder, place, service: None, _alone: alone })
    }

    /// Starts the service, on a display when one is named and without any otherwise, and waits until it takes clients.
    pub fn start(&mut self, display: Option<&str>) {
        let mut command = Command::new(self.folder.join("service"));
        command.env("XDG_RUNTIME_DIR", &self.place).env_remove("WAYLAND_DISPLAY").env_remove("DISPLAY");
        match display {
            Some(display) => command.env("DISPLAY", display).env("XRT_COMPOSITOR_FORCE_XCB", "1"),
            None => command.env("XRT_COMPOSITOR_NULL", "1"),
        };
        let log = std::fs::File::create(self.place.join("service.log")).unwrap();
        let service = command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap();
        self.service = Some(service);
        let start = Instant::now();
        while !self.place.join("monado_comp_ipc").exists() {
            let ended = self.service.as_mut().unwrap().try_wait().unwrap();
            assert!(ended.is_none(), "Monado ended: {}", self.log());
            assert!(start.elapsed() < Duration::from_secs(120), "Monado does not listen: {}", self.log());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Kills the service, as a crash would.
    pub fn kill(&mut self) {
        if let Some(mut service) = self.service.take() {
            // It may have ended by itself; either way it must not outlive the test.
            let _ = service.kill();
            let _ = service.wait();
        }
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(self.place.join("service.log")).unwrap_or_default()
    }

    /// A folder for what a test writes; it goes with this value.
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// A command that runs a program where it finds the runtime.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(self.folder.join("run"));
        command
            .arg(program)
            .env("XDG_RUNTIME_DIR", &self.place)
            .env("XDG_CACHE_HOME", &self.place)
            .env("WGPU_BACKEND", "vulkan")
            .env("WGPU_ADAPTER_NAME", "llvmpipe")
            .env_remove("WAYLAND_DISPLAY");
        command
    }

    /// A command that runs a test of `inner` there.
    pub fn inner(&self, test: &str) -> Command {
        let mut command = self.command(&std::env::current_exe().unwrap());
        command.args(["--exact", &format!("inner::{test}"), "--ignored", "--nocapture"]).env_remove("DISPLAY");
        command
    }
}

impl Drop for Monado {
    fn drop(&mut self) {
        self.kill();
        if std::thread::panicking() {
            eprintln!("Monado said:\n{}", self.log());
        }
        std::fs::remove_dir_all(&self.place).unwrap();
    }
}

/// What a program said on both of its outputs, after it has succeeded.
pub fn said(output: &Output) -> String {
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{text}");
    text
}
