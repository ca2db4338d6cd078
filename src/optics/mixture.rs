//! Resins dithered into one another, voxel by voxel, seen from so far that they are one.
//!
//! In what light does they add by volume: events per mm of each resin count by its share, and the phase function is
//! that of the events' mean cosine. That holds where the grains are small beside the way between two events; for voxels
//! see [`Grains`].

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{
    ChannelId, Grains, KubelkaMunk, MaterialFile, MaterialSet, OpticsError, ResinId, Stack, VolumeCoefficients,
};
use crate::words::excerpt;

/// Resins and their shares of the volume; one alone is pure.
///
/// ```
/// use lumislice::optics::{Mixture, ResinId};
///
/// let grey = Mixture::new([(ResinId(1), 0.1), (ResinId(0), 0.9)]).unwrap();
/// assert_eq!(grey.share(ResinId(1)), 0.1);
/// assert_eq!(grey.pure(), None);
/// assert_eq!(Mixture::from(ResinId(2)).pure(), Some(ResinId(2)));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<(ResinId, f64)>", into = "Vec<(ResinId, f64)>")]
pub struct Mixture {
    /// By resin, each once, shares above 0 that sum to 1.
    parts: Vec<(ResinId, f64)>,
}

/// Shares may sum to this much more or less than 1.
const SUM_SLACK: f64 = 1e-6;

impl TryFrom<Vec<(ResinId, f64)>> for Mixture {
    type Error = &'static str;

    fn try_from(parts: Vec<(ResinId, f64)>) -> Result<Self, Self::Error> {
        Self::new(parts).ok_or("shares that are not 0 to 1, or do not sum to 1")
    }
}

impl From<Mixture> for Vec<(ResinId, f64)> {
    fn from(mixture: Mixture) -> Self {
        mixture.parts
    }
}

impl Mixture {
    /// Resins with their shares; those of 0 are left out, those of one resin are one. `None` unless all are at least 0
    /// and they sum to 1 within 1e-6.
    pub fn new(parts: impl IntoIterator<Item = (ResinId, f64)>) -> Option<Self> {
        let mut by_resin: Vec<(ResinId, f64)> = Vec::new();
        for (resin, share) in parts {
            if !(0.0..=1.0 + SUM_SLACK).contains(&share) {
                return None;
            }
            match by_resin.binary_search_by_key(&resin, |part| part.0) {
                Ok(known) => by_resin[known].1 += share,
                Err(_) if share == 0.0 => {}
                Err(place) => by_resin.insert(place, (resin, share)),
            }
        }
        let sum: f64 = by_resin.iter().map(|part| part.1).sum();
        if !((sum - 1.0).abs() <= SUM_SLACK) {
            return None;
        }
        if let [only] = &mut by_resin[..] {
            only.1 = 1.0;
        }
        Some(Self { parts: by_resin })
    }

    /// The resins that a mixture's name names, with their shares; of a resin's name it alone. `None` for what is no
    /// list of shares; whether they sum to 100% is not checked.
    ///
    /// ```
    /// use lumislice::optics::Mixture;
    ///
    /// assert_eq!(Mixture::parts_of_name("75% white + 25% black"), Some(vec![("white", 0.75), ("black", 0.25)]));
    /// assert_eq!(Mixture::parts_of_name("white"), Some(vec![("white", 1.0)]));
    /// assert_eq!(Mixture::parts_of_name("75% white + black"), None);
    /// ```
    pub fn parts_of_name(name: &str) -> Option<Vec<(&str, f64)>> {
        // No resin's name holds a percent sign.
        if !name.contains('%') {
            return Some(vec![(name, 1.0)]);
        }
        let part = |text| {
            let (share, resin) = str::split_once(text, '%')?;
            let share: f64 = share.trim().parse().ok()?;
            Some((resin.trim(), share / 100.0))
        };
        // A name may hold a plus sign, so that one between blanks parts them.
        name.split(" + ").map(part).collect()
    }

    /// The resins by their index, with their shares: above 0, and 1 in sum.
    pub fn parts(&self) -> &[(ResinId, f64)] {
        &self.parts
    }

    /// The resin, if it is only one.
    pub fn pure(&self) -> Option<ResinId> {
        if let [(resin, _)] = self.parts[..] { Some(resin) } else { None }
    }

    /// The share of a resin, 0 to 1.
    pub fn share(&self, resin: ResinId) -> f64 {
        self.parts.iter().find(|part| part.0 == resin).map_or(0.0, |part| part.1)
    }
}

impl Mixture {
    /// The mixture in words, with the names of its resins: `white`, or `90% white + 10% black`, the most first.
    pub fn name<'a>(&self, resin: impl Fn(ResinId) -> &'a str) -> String {
        if let Some(pure) = self.pure() {
            return resin(pure).to_owned();
        }
        let mut parts = self.parts.clone();
        parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let words: Vec<_> = parts.iter().map(|(id, share)| format!("{}% {}", percent(*share), resin(*id))).collect();
        words.join(" + ")
    }
}

impl From<ResinId> for Mixture {
    fn from(resin: ResinId) -> Self {
        Self { parts: vec![(resin, 1.0)] }
    }
}

impl From<Stack> for Stack<Mixture> {
    fn from(stack: Stack) -> Self {
        stack.map(|&resin| resin.into())
    }
}

impl Stack<Mixture> {
    /// The same stack of resins, if every layer and the core are one each.
    pub fn pure(&self) -> Option<Stack> {
        self.try_map(|mixture| mixture.pure().ok_or(())).ok()
    }
}

impl VolumeCoefficients {
    /// What `parts`, coefficients with their shares of the volume, are together: events per mm add by volume, g by
    /// scattering, the refractive index by volume. One part alone keeps its bits.
    pub fn mixed(parts: impl IntoIterator<Item = (Self, f64)>) -> Self {
        let (mut sum, mut count, mut cosine) =
            (Self { sigma_s: 0.0, sigma_a: 0.0, g: 0.0, refractive_index: 0.0 }, 0, 0.0);
        let (mut last, mut one_index) = (sum, true);
        for (part, share) in parts {
            sum.sigma_s += share * part.sigma_s;
            sum.sigma_a += share * part.sigma_a;
            sum.refractive_index += share * part.refractive_index;
            cosine += share * part.sigma_s * part.g;
            one_index &= count == 0 || part.refractive_index == last.refractive_index;
            (last, count) = (part, count + 1);
        }
        if count == 1 {
            return last;
        }
        // Rounded, one index would be another, and a boundary.
        if one_index {
            sum.refractive_index = last.refractive_index;
        }
        Self { g: if sum.sigma_s > 0.0 { cosine / sum.sigma_s } else { 0.0 }, ..sum }
    }
}

impl MaterialSet {
    /// The Kubelka–Munk parameters of a mixture of the set's resins in one channel.
    pub(crate) fn mixed_kubelka_munk(&self, mixture: &Mixture, channel: ChannelId) -> Cow<'_, KubelkaMunk> {
        match mixture.pure() {
            Some(resin) => Cow::Borrowed(&self[resin][channel].kubelka_munk),
            None => {
                let parts = mixture.parts.iter().map(|&(resin, share)| (&self[resin][channel].kubelka_munk, share));
                Cow::Owned(KubelkaMunk::mixed(parts))
            }
        }
    }

    /// The refractive index of a mixture of the set's resins, by volume.
    pub(crate) fn refractive_index(&self, mixture: &Mixture) -> f64 {
        let of = |resin: ResinId| self[resin].refractive_index;
        let first = mixture.parts.first().map_or(1.0, |part| of(part.0));
        // Rounded, one index would be another, and a boundary.
        if mixture.parts.iter().all(|part| of(part.0) == first) {
            return first;
        }
        mixture.parts.iter().map(|&(resin, share)| share * of(resin)).sum()
    }

    /// The coefficients of a mixture of the set's resins, by channel, in the set's [`Grains`].
    ///
    /// # Errors
    /// [`OpticsError::NoCoefficients`].
    pub fn mixed_volumes(&self, mixture: &Mixture) -> Result<Vec<VolumeCoefficients>, OpticsError> {
        mixed_volumes(mixture, self.channels.len(), self.grains, |resin| self[resin].needed_volumes())
    }

    /// A mixture in words, which [`Self::mixture`] reads: `white`, or `90% white + 10% black`, the most first.
    pub fn mixture_name(&self, mixture: &Mixture) -> String {
        mixture.name(|resin| &self[resin].name)
    }

    /// A mixture by its name: a resin's, or shares of the volume of several, `90% white + 10% black`.
    ///
    /// # Errors
    /// [`OpticsError::UnknownResin`]; [`OpticsError::Parameter`] for shares that do not sum to 100%.
    pub fn mixture(&self, name: &str) -> Result<Mixture, OpticsError> {
        read(name, |name| match self.resin(name) {
            Some((id, _)) => Ok(id),
            None => Err(OpticsError::unknown_resin(name, &self.name, self.resins.iter().map(|resin| &*resin.name))),
        })
    }

    /// A stack of named mixtures as one of the set's.
    ///
    /// # Errors
    /// As [`Self::mixture`].
    pub fn mixed_stack(&self, named: &Stack<String>) -> Result<Stack<Mixture>, OpticsError> {
        named.try_map(|name| self.mixture(name))
    }
}

impl MaterialFile {
    /// The coefficients of a mixture of the file's resins, by channel, in fine grains.
    pub(super) fn mixed_volumes(&self, mixture: &Mixture) -> Result<Vec<VolumeCoefficients>, OpticsError> {
        mixed_volumes(mixture, self.channels().len(), Grains::FINE, |resin| Ok(self.needed_volumes(resin)?.to_vec()))
    }

    /// A stack of named mixtures as one of the file's.
    ///
    /// # Errors
    /// As [`MaterialSet::mixture`].
    pub fn mixed_stack(&self, named: &Stack<String>) -> Result<Stack<Mixture>, OpticsError> {
        named.try_map(|name| read(name, |name| self.resin_id(name)))
    }
}

fn mixed_volumes(
    mixture: &Mixture,
    channels: usize,
    grains: Grains,
    volumes: impl Fn(ResinId) -> Result<Vec<VolumeCoefficients>, OpticsError>,
) -> Result<Vec<VolumeCoefficients>, OpticsError> {
    let parts = mixture.parts.iter().map(|&(resin, share)| Ok((volumes(resin)?, share)));
    let parts = parts.collect::<Result<Vec<_>, OpticsError>>()?;
    let in_channel = |channel: usize| {
        let parts: Vec<_> = parts.iter().map(|(volumes, share)| (volumes[channel], *share)).collect();
        grains.mixed(&parts)
    };
    Ok((0..channels).map(in_channel).collect())
}

/// What a mixture's shares should be.
pub(crate) const SHARES: &str = "shares that sum to 100%, such as 90% white + 10% black";

/// Reads the name of a mixture of the resins that `known` knows.
fn read(name: &str, known: impl Fn(&str) -> Result<ResinId, OpticsError>) -> Result<Mixture, OpticsError> {
    if !name.contains('%') {
        return known(name).map(Mixture::from);
    }
    let fault = || OpticsError::parameter("a mixture", format!("\"{}\"", excerpt(name)), SHARES.to_owned());
    let parts = Mixture::parts_of_name(name).ok_or_else(fault)?;
    let parts = parts.into_iter().map(|(resin, share)| Ok((known(resin)?, share)));
    Mixture::new(parts.collect::<Result<Vec<_>, OpticsError>>()?).ok_or_else(fault)
}

/// A share in percent, to a millionth of the whole.
fn percent(share: f64) -> f64 {
    (share * 1e6).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        let set = MaterialSet::builtin("synthetic").unwrap();
        for name in ["white", "90% white + 10% black", "62.5% support + 30% white + 7.5% black"] {
            assert_eq!(set.mixture_name(&set.mixture(name).unwrap()), name);
        }
        for (name, words) in [
            ("whit", "did you mean `white`?"),
            ("90% white + 20% black", "sum to 100%"),
            ("90% white + 10% blakc", "did you mean `black`?"),
            ("-10% white + 110% black", "sum to 100%"),
            ("10% black+90% white", "unknown"),
            ("nan% white + 10% black", "sum to 100%"),
        ] {
            let error = set.mixture(name).unwrap_err().to_string();
            assert!(error.contains(words), "{name}: {error}");
        }
    }

    #[test]
    fn coefficients_add_by_volume() {
        let dark = VolumeCoefficients { sigma_s: 1.0, sigma_a: 9.0, g: 0.2, refractive_index: 1.5 };
        let light = VolumeCoefficients { sigma_s: 20.0, sigma_a: 0.0, g: 0.8, refractive_index: 1.5 };
        let mixed = VolumeCoefficients::mixed([(light, 0.75), (dark, 0.25)]);
        assert_eq!((mixed.sigma_s, mixed.sigma_a, mixed.refractive_index), (15.25, 2.25, 1.5));
        assert!((mixed.g - (0.75 * 20.0 * 0.8 + 0.25 * 0.2) / 15.25).abs() < 1e-15);
        assert_eq!(VolumeCoefficients::mixed([(dark, 1.0)]), dark);
        let thirds =
            VolumeCoefficients::mixed([(light, 0.95), (dark, 0.0125), (dark, 0.0125), (light, 0.0125), (dark, 0.0125)]);
        assert_eq!(thirds.refractive_index, 1.5);
    }

    #[test]
    fn shares_are_shares() {
        let [a, b] = [ResinId(0), ResinId(1)];
        assert_eq!(Mixture::new([(b, 0.25), (a, 0.5), (b, 0.25)]).unwrap().parts(), [(a, 0.5), (b, 0.5)]);
        assert_eq!(Mixture::new([(a, 1.0), (b, 0.0)]), Some(a.into()));
        assert_eq!(Mixture::new([(a, 0.5), (b, 0.4)]), None);
        assert_eq!(Mixture::new([(a, -0.5), (b, 1.5)]), None);
        assert_eq!(Mixture::new([]), None);
        assert_eq!(Mixture::new([(a, f64::NAN)]), None);
    }
}
