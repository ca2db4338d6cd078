//! What the machine has.

/// Memory, bytes, where the system tells it as Linux does.
pub fn memory_bytes() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let total = told.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(total.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

/// The memory there is, where `needed` bytes are known to be more.
pub fn short_of(needed: u64) -> Option<u64> {
    memory_bytes().filter(|there| needed > *there)
}

/// In MiB, as users are told.
pub fn mib(bytes: u64) -> u64 {
    bytes >> 20
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn the_machine_has_memory() {
        assert!(super::memory_bytes().is_some_and(|bytes| bytes > 64 << 20));
        assert_eq!(super::short_of(1 << 20), None);
        assert_eq!(super::short_of(u64::MAX), super::memory_bytes());
    }
}
