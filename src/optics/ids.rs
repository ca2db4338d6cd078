//! Which resin, and which colour channel: indices that cannot be taken for one another.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A resin of a [`MaterialSet`](super::MaterialSet): its index there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ResinId(pub usize);

/// A colour channel of a [`MaterialSet`](super::MaterialSet): its index there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ChannelId(pub usize);

impl fmt::Display for ResinId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for ChannelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
