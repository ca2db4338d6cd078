//! What the machine has.

/// Memory that may be used, bytes, where the system tells it as Linux does: the machine's, or less where a container or
/// the process is held to less.
pub fn memory_bytes() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let total = told.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let total = total.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10;
    Some([of_control_group(), of_process()].into_iter().flatten().fold(total, u64::min))
}

/// What a container may use.
fn of_control_group() -> Option<u64> {
    std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok()?.trim().parse().ok()
}

/// What `ulimit -v` leaves.
fn of_process() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/self/limits").ok()?;
    let limit = told.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    limit.split_whitespace().next()?.parse().ok()
}

/// What does not fit, in the words of every refusal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shortage {
    /// "which need about … of memory", to go after what needs it.
    pub needs: String,
    /// What there is.
    pub expected: String,
}

/// The shortage, where `needed` bytes are known to be more than there are.
pub fn short_of(needed: u64) -> Option<Shortage> {
    memory_bytes().filter(|there| needed > *there).map(|there| Shortage {
        needs: format!("which need about {} MiB of memory", needed >> 20),
        expected: format!("at most the {} MiB that this machine has", there >> 20),
    })
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn the_machine_has_memory() {
        assert!(super::memory_bytes().is_some_and(|bytes| bytes > 64 << 20));
        assert_eq!(super::short_of(1 << 20), None);
        let shortage = super::short_of(u64::MAX).unwrap();
        assert_eq!(shortage.needs, format!("which need about {} MiB of memory", u64::MAX >> 20));
        let there = super::memory_bytes().unwrap() >> 20;
        assert_eq!(shortage.expected, format!("at most the {there} MiB that this machine has"));
    }
}
