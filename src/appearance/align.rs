//! One material sequence for all stackings: Hašan et al. 2010, section 7.1, "thickness interpolation".
//!
//! Virtual layers of zero thickness are inserted until every stacking runs through the same periodic sequence of
//! resins, as white–support–black–white…; then thicknesses can be interpolated between neighbours, slot by slot. The
//! paper takes the period as given. Here it is the permutation of the used resins that makes the sequence shortest,
//! since every slot costs time in every voxel; the last period is cut after its last used slot.
//!
//! Stackings with mixtures are mostly a family: as many layers each, in the same order, some of thickness 0. Those are
//! aligned layer by layer ([`align_mixtures`]), and what is interpolated in a slot of mixtures are the amounts of its
//! resins, thickness × share.

use crate::optics::{Mixture, ResinId, Stack};

/// Stackings over one sequence of resins.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignedStackings {
    /// Resin of each slot, top first; periodic where all are pure. Of a slot of mixtures the first of its resins.
    pub sequence: Vec<ResinId>,
    /// Slots in a period: the number of resins used.
    pub period: usize,
    /// Thickness in mm, row-major `[stacking][slot]`; 0 where the stacking skips the slot.
    pub thickness: Vec<f64>,
    /// Number of stackings.
    pub len: usize,
    /// The slots that are mixtures, from the top.
    pub mixed: Vec<MixedSlot>,
}

/// A slot in which some stacking has a mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct MixedSlot {
    /// Which slot.
    pub slot: usize,
    /// All resins that any stacking has there, ascending.
    pub resins: Vec<ResinId>,
    /// Their shares of the slot's volume, row-major `[stacking][resin]`; 0 where the stacking skips the slot.
    pub shares: Vec<f64>,
}

impl MixedSlot {
    /// Shares of the resins in one stacking.
    pub fn row(&self, stacking: usize) -> &[f64] {
        &self.shares[stacking * self.resins.len()..(stacking + 1) * self.resins.len()]
    }
}

/// Up to here all orders are tried (7! = 5040, a few ms for hundreds of stackings); beyond, swaps improve a first
/// guess.
const ALL_ORDERS: usize = 7;

/// Aligns `stackings` to the shortest periodic sequence; ties go to the lexically first order of resin
/// indices, so the order of a material file decides what lies on top between two stackings.
pub fn align(stackings: &[Stack]) -> AlignedStackings {
    let mut chains: Vec<Vec<usize>> =
        stackings.iter().map(|stacking| stacking.layers.iter().map(|layer| layer.resin.0).collect()).collect();
    let mut resins: Vec<usize> = chains.iter().flatten().copied().collect();
    resins.sort_unstable();
    resins.dedup();
    // From here on a resin is its index in `resins`.
    for chain in &mut chains {
        for resin in chain {
            *resin = resins.partition_point(|known| known < resin);
        }
    }
    let mut distinct = chains.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let order = if resins.len() <= ALL_ORDERS {
        best_order(&distinct, resins.len())
    } else {
        good_order(&distinct, resins.len())
    };
    let rank = inverse(&order);

    let period = order.len();
    let length = length(&distinct, &rank, usize::MAX).unwrap_or_default();
    let sequence = (0..length).map(|slot| ResinId(resins[order[slot % period]])).collect();
    let mut thickness = vec![0.0; length * stackings.len()];
    for (row, (stacking, chain)) in stackings.iter().zip(&chains).enumerate() {
        for (layer, slot) in stacking.layers.iter().zip(slots(chain, &rank)) {
            thickness[row * length + slot] = layer.thickness_mm;
        }
    }
    AlignedStackings { sequence, period, thickness, len: stackings.len(), mixed: Vec::new() }
}

/// Aligns stackings of mixtures: pure ones as [`align`] does, a family layer by layer. Others are aligned like resins,
/// where all mixtures of the same resins count as one.
pub fn align_mixtures(stackings: &[Stack<Mixture>]) -> AlignedStackings {
    if let Some(pure) = stackings.iter().map(Stack::<Mixture>::pure).collect::<Option<Vec<_>>>() {
        return align(&pure);
    }
    if is_family(stackings) {
        let slots = stackings.first().map_or(0, |stacking| stacking.layers.len());
        let thickness = stackings.iter().flat_map(|stacking| stacking.pairs().map(|(_, mm)| mm)).collect();
        let places = stackings.iter().map(|_| (0..slots).collect()).collect::<Vec<_>>();
        return with_mixtures(stackings, &places, vec![Vec::new(); slots], slots, thickness);
    }
    let resins = |mixture: &Mixture| mixture.parts().iter().map(|part| part.0).collect::<Vec<_>>();
    let mut kinds: Vec<_> = stackings.iter().flat_map(Stack::pairs).map(|(mixture, _)| resins(mixture)).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let kind = |mixture: &Mixture| ResinId(kinds.partition_point(|known| *known < resins(mixture)));
    let of_kinds: Vec<Stack> = stackings.iter().map(|stacking| stacking.map(kind)).collect();
    let AlignedStackings { sequence, period, thickness, .. } = align(&of_kinds);
    let place = |stacking: &Stack| {
        let mut next = 0;
        let found = stacking.layers.iter().map(|layer| {
            let slot = next + sequence[next..].iter().position(|kind| *kind == layer.resin).unwrap_or_default();
            next = slot + 1;
            slot
        });
        found.collect::<Vec<_>>()
    };
    let places: Vec<_> = of_kinds.iter().map(place).collect();
    let resins = sequence.iter().map(|kind| kinds[kind.0].clone()).collect();
    with_mixtures(stackings, &places, resins, period, thickness)
}

/// Whether slot i of one stacking is slot i of every other: as many layers each, and where they differ in their resins
/// only those that are mixed there in some stacking.
fn is_family(stackings: &[Stack<Mixture>]) -> bool {
    let slots = stackings.first().map_or(0, |stacking| stacking.layers.len());
    let alike = |slot: usize| {
        let here = || stackings.iter().map(|stacking| &stacking.layers[slot].resin);
        let same = here().all(|mixture| mixture.pure().is_some() && Some(mixture) == here().next());
        let mixed = |resin: ResinId| here().any(|mixture| mixture.pure().is_none() && mixture.share(resin) > 0.0);
        same || here().all(|mixture| mixture.parts().iter().all(|part| mixed(part.0)))
    };
    stackings.iter().all(|stacking| stacking.layers.len() == slots) && (0..slots).all(alike)
}

/// The layers of `stackings`, each at its place among the slots, some of whose `resins` are known.
fn with_mixtures(
    stackings: &[Stack<Mixture>],
    places: &[Vec<usize>],
    mut resins: Vec<Vec<ResinId>>,
    period: usize,
    thickness: Vec<f64>,
) -> AlignedStackings {
    let laid = || stackings.iter().zip(places).map(|(stacking, places)| places.iter().zip(&stacking.layers));
    for (&slot, layer) in laid().flatten() {
        resins[slot].extend(layer.resin.parts().iter().map(|part| part.0));
    }
    for resins in &mut resins {
        resins.sort_unstable();
        resins.dedup();
    }
    let sequence = resins.iter().filter_map(|resins| resins.first().copied()).collect();
    let mixed = resins.into_iter().enumerate().filter(|(_, resins)| resins.len() > 1).map(|(slot, resins)| {
        let shares = laid().flat_map(|mut layers| {
            let here = layers.find(|(place, _)| **place == slot).map(|(_, layer)| &layer.resin);
            resins.iter().map(move |&resin| here.map_or(0.0, |mixture| mixture.share(resin))).collect::<Vec<_>>()
        });
        MixedSlot { slot, shares: shares.collect(), resins }
    });
    let mixed = mixed.collect();
    AlignedStackings { sequence, period, thickness, len: stackings.len(), mixed }
}

impl AlignedStackings {
    /// Thickness of each slot of one stacking, mm.
    pub fn row(&self, stacking: usize) -> &[f64] {
        let length = self.sequence.len();
        &self.thickness[stacking * length..(stacking + 1) * length]
    }

    /// Depth of each slot's lower end, mm, row-major `[stacking][slot]`.
    pub fn bottoms(&self) -> Vec<f64> {
        let mut bottoms = Vec::with_capacity(self.thickness.len());
        for stacking in 0..self.len {
            let mut depth = 0.0;
            bottoms.extend(self.row(stacking).iter().map(|thickness| {
                depth += thickness;
                depth
            }));
        }
        bottoms
    }

    /// The resins of a slot, ascending.
    pub fn resins(&self, slot: usize) -> &[ResinId] {
        match self.mixed.iter().find(|mixed| mixed.slot == slot) {
            Some(mixed) => &mixed.resins,
            None => std::slice::from_ref(&self.sequence[slot]),
        }
    }

    /// The layers of a stacking of resins without the virtual ones.
    pub fn collapse(&self, stacking: usize) -> Stack {
        Stack::joined(self.sequence.iter().copied().zip(self.row(stacking).iter().copied()))
    }
}

/// The slots a chain of resins takes when each layer goes to the first free slot of its resin.
fn slots<'a>(chain: &'a [usize], rank: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
    let period = rank.len();
    let mut next = 0;
    chain.iter().map(move |&resin| {
        let slot = next + (rank[resin] + period - next % period) % period;
        next = slot + 1;
        slot
    })
}

/// Slots of the longest chain, if below `limit`.
fn length(chains: &[Vec<usize>], rank: &[usize], limit: usize) -> Option<usize> {
    let mut longest = 0;
    for chain in chains {
        longest = longest.max(slots(chain, rank).last().map_or(0, |slot| slot + 1));
        if longest >= limit {
            return None;
        }
    }
    Some(longest)
}

fn inverse(order: &[usize]) -> Vec<usize> {
    let mut rank = vec![0; order.len()];
    for (position, &resin) in order.iter().enumerate() {
        rank[resin] = position;
    }
    rank
}

/// The cheapest of all orders.
fn best_order(chains: &[Vec<usize>], resins: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..resins).collect();
    let mut best = (length(chains, &order, usize::MAX).unwrap_or_default(), order.clone());
    while next_permutation(&mut order) {
        if let Some(shorter) = length(chains, &inverse(&order), best.0) {
            best = (shorter, order.clone());
        }
    }
    best.1
}

/// Swaps of two resins until none helps.
fn good_order(chains: &[Vec<usize>], resins: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..resins).collect();
    let mut best = length(chains, &order, usize::MAX).unwrap_or_default();
    loop {
        let before = best;
        for a in 0..resins {
            for b in a + 1..resins {
                order.swap(a, b);
                match length(chains, &inverse(&order), best) {
                    Some(shorter) => best = shorter,
                    None => order.swap(a, b),
                }
            }
        }
        if best == before {
            return order;
        }
    }
}

/// The lexically next permutation; false after the last.
fn next_permutation(order: &mut [usize]) -> bool {
    let Some(pivot) = (1..order.len()).rev().find(|&i| order[i - 1] < order[i]).map(|i| i - 1) else { return false };
    if let Some(above) = (pivot + 1..order.len()).rev().find(|&i| order[i] > order[pivot]) {
        order.swap(pivot, above);
    }
    order[pivot + 1..].reverse();
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stackings(resins: usize) -> impl Strategy<Value = Vec<Stack>> {
        let layer = ((0..resins).prop_map(ResinId), 0.01..2.0f64);
        prop::collection::vec(prop::collection::vec(layer, 0..7), 0..12)
            .prop_map(|rows| rows.into_iter().map(Stack::joined).collect())
    }

    /// The shortest sequence over all orders, found without ranks or pruning.
    fn shortest(stackings: &[Stack], resins: usize) -> usize {
        let mut order: Vec<usize> = (0..resins).collect();
        let mut best = usize::MAX;
        loop {
            let used: Vec<usize> = order
                .iter()
                .copied()
                .filter(|r| stackings.iter().any(|s| s.layers.iter().any(|l| l.resin.0 == *r)))
                .collect();
            let length = |stacking: &Stack| {
                let mut slots = used.iter().cycle();
                stacking.layers.iter().map(|layer| slots.position_in(layer.resin.0)).sum::<usize>()
            };
            best = best.min(stackings.iter().map(length).max().unwrap_or(0));
            if !next_permutation(&mut order) {
                return best;
            }
        }
    }

    trait PositionIn {
        /// Slots taken to reach `resin`, itself included.
        fn position_in(&mut self, resin: usize) -> usize;
    }

    impl<'a, I: Iterator<Item = &'a usize>> PositionIn for I {
        fn position_in(&mut self, resin: usize) -> usize {
            self.position(|r| *r == resin).unwrap() + 1
        }
    }

    proptest! {
        #[test]
        fn collapsing_returns_the_stackings(stackings in stackings(5)) {
            let aligned = align(&stackings);
            for (i, stacking) in stackings.iter().enumerate() {
                prop_assert_eq!(&aligned.collapse(i), stacking);
            }
        }

        #[test]
        fn sequence_is_periodic_and_shortest(stackings in stackings(4)) {
            let aligned = align(&stackings);
            let later = aligned.sequence.iter().skip(aligned.period);
            prop_assert!(aligned.sequence.iter().zip(later).all(|(a, b)| a == b));
            prop_assert_eq!(aligned.sequence.len(), shortest(&stackings, 4));
        }

        #[test]
        fn many_resins_align_too(stackings in stackings(10)) {
            let aligned = align(&stackings);
            for (i, stacking) in stackings.iter().enumerate() {
                prop_assert_eq!(&aligned.collapse(i), stacking);
            }
        }

        #[test]
        fn bottoms_never_rise(stackings in stackings(3)) {
            let aligned = align(&stackings);
            let bottoms = aligned.bottoms();
            for row in bottoms.chunks(aligned.sequence.len().max(1)) {
                prop_assert!(row.is_sorted());
            }
        }
    }

    #[test]
    fn the_papers_period() {
        let [white, support, black] = [0, 1, 2].map(ResinId);
        let stackings = [
            Stack::new([(white, 0.2), (support, 2.0), (black, 1.0)]),
            Stack::new([(white, 1.0), (black, 0.5), (white, 3.0)]),
            Stack::new([(support, 1.0), (black, 1.0)]),
        ];
        let aligned = align(&stackings);
        assert_eq!(aligned.sequence, [white, support, black, white]);
        assert_eq!(aligned.row(1), [1.0, 0.0, 0.5, 3.0]);
        assert_eq!(aligned.row(2), [0.0, 1.0, 1.0, 0.0]);
    }

    /// White with shares of black, over support of any thickness, over white.
    #[test]
    fn a_family_is_aligned_layer_by_layer() {
        let [white, support, black] = [0, 1, 2].map(ResinId);
        let one = |dark: f64, grey_mm: f64, clear_mm: f64| {
            let grey = Mixture::new([(white, 1.0 - dark), (black, dark)]).unwrap();
            Stack::new([(grey, grey_mm), (support.into(), clear_mm), (white.into(), 0.5)])
        };
        let aligned = align_mixtures(&[one(0.1, 0.3, 0.0), one(0.0, 0.5, 1.0), one(0.4, 0.2, 0.2)]);
        assert_eq!(aligned.sequence, [white, support, white]);
        assert_eq!(aligned.row(0), [0.3, 0.0, 0.5]);
        let shares = vec![0.9, 0.1, 1.0, 0.0, 0.6, 0.4];
        assert_eq!(aligned.mixed, [MixedSlot { slot: 0, resins: vec![white, black], shares }]);
        assert_eq!(aligned.resins(0), [white, black]);
        assert_eq!(aligned.resins(1), [support]);
    }

    /// In one the support lies above the white, in the other below: no slot may mix them.
    #[test]
    fn what_is_no_family_is_aligned_by_its_resins() {
        let [white, support, black] = [0, 1, 2].map(ResinId);
        let grey = Mixture::new([(white, 0.75), (black, 0.25)]).unwrap();
        let pure = |resin: ResinId| Mixture::from(resin);
        let stackings = [
            Stack::new([(grey.clone(), 0.3), (pure(support), 1.0), (pure(white), 0.5)]),
            Stack::new([(grey, 0.3), (pure(white), 0.5), (pure(support), 1.0)]),
        ];
        let aligned = align_mixtures(&stackings);
        assert!(
            (0..aligned.sequence.len())
                .all(|slot| !aligned.resins(slot).contains(&support) || aligned.resins(slot) == [support])
        );
        for stacking in 0..2 {
            assert!((aligned.row(stacking).iter().sum::<f64>() - 1.8).abs() < 1e-12);
        }
        assert_eq!(aligned.mixed[0].row(1), [0.75, 0.25]);
        let pure: Vec<_> =
            stackings.iter().map(|s| Stack::new(s.pairs().skip(1).map(|(m, mm)| (m.pure().unwrap(), mm)))).collect();
        let mixtures: Vec<Stack<Mixture>> = pure.iter().cloned().map(Into::into).collect();
        assert_eq!(align_mixtures(&mixtures), align(&pure));
    }

    #[test]
    fn nothing_aligns_to_nothing() {
        assert!(align(&[]).sequence.is_empty());
        let bare = align(&[Stack::default()]);
        assert_eq!((bare.sequence.len(), bare.len, bare.collapse(0)), (0, 1, Stack::default()));
    }
}
