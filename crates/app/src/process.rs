//! What this process has used, as Linux says it; elsewhere it is not known.

/// CPU seconds of all its threads; NaN where the system does not say.
pub fn cpu_secs() -> f64 {
    let Ok(text) = std::fs::read_to_string("/proc/self/stat") else { return f64::NAN };
    // The second field, the program's name, may hold blanks; it ends with the last parenthesis. User and system time are
    // fields 14 and 15, in hundredths of a second.
    let fields = text.rsplit_once(')').map(|(_, rest)| rest.split_whitespace().collect::<Vec<_>>());
    let ticks = |index: usize| fields.as_ref().and_then(|f| f.get(index)?.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}

/// Resident memory in bytes; a software adapter's memory is part of it.
pub fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// Processes that were runnable in the last minute, on average: other work makes times longer.
pub fn load() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

#[cfg(all(test, target_os = "linux"))]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn work_takes_processor_time_and_memory() {
        let before = cpu_secs();
        let start = std::time::Instant::now();
        while start.elapsed().as_secs_f64() < 0.1 {
            std::hint::black_box(before.sqrt());
        }
        let taken = cpu_secs() - before;
        assert!(taken > 0.0, "{taken}");
        assert!(resident_bytes().unwrap() > 1 << 20 && load().unwrap() >= 0.0);
    }
}
