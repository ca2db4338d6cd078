//! Numbers by group, in the order in which they came.

/// Members of groups, group after group.
#[derive(Debug)]
pub struct Groups {
    /// Where each group's members begin.
    first: Vec<u32>,
    members: Vec<u32>,
}

impl Groups {
    /// Sorts the pairs of group and member that `pairs` gives, alike each time it is called, into `groups` groups.
    pub fn new<I: Iterator<Item = (u32, u32)>>(groups: usize, pairs: impl Fn() -> I) -> Self {
        let mut first = vec![0_u32; groups + 1];
        for (group, _) in pairs() {
            first[group as usize + 1] += 1;
        }
        for n in 1..first.len() {
            first[n] += first[n - 1];
        }
        let mut next = first.clone();
        let mut members = vec![0; first[groups] as usize];
        for (group, member) in pairs() {
            members[next[group as usize] as usize] = member;
            next[group as usize] += 1;
        }
        Self { first, members }
    }

    /// The members of a group.
    pub fn of(&self, group: u32) -> &[u32] {
        let [first, end] = [0, 1].map(|n| self.first[group as usize + n] as usize);
        &self.members[first..end]
    }
}
