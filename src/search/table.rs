//! The blocks of Hašan et al. 2010, section 6.2, precomputed: every resin at every power-of-two thickness.

use super::endings::Endings;
use super::envelope::envelope;
use super::forward::reflection_of;
use super::kernels::{Block, CHUNK, Goal};
use super::options::UnitLimit;
use super::{Match, SearchError, SearchOptions, SearchTarget};
use crate::optics::{ChannelId, KubelkaMunk, ResinId, Stack};

/// Everything the searches for all targets share. Build it once, search from any number of threads.
pub(super) struct BlockTable {
    pub(super) options: SearchOptions,
    pub(super) limits: Vec<UnitLimit>,
    /// `[resin][channel]`
    pub(super) resins: Vec<Vec<KubelkaMunk>>,
    /// Block thicknesses in units, ascending: 1, 2, 4 … ≤ n.
    pub(super) sizes: Vec<usize>,
    /// Blocks, index `[resin][size]`.
    pub(super) blocks: Vec<Vec<Block>>,
    /// R̂ of the half-space below, by lane; 0 without a core.
    pub(super) base: Vec<f64>,
    /// R̂ of each block on that half-space, index `[resin][size]`, by lane.
    pub(super) block_over_base: Vec<Vec<Vec<f64>>>,
    /// Least R̂ of anything u units thick on the half-space, index `[u]`, by lane.
    pub(super) darkest: Vec<Vec<f64>>,
    /// Greatest R̂ of anything u units thick on the half-space, index `[u]`, by lane.
    pub(super) brightest: Vec<Vec<f64>>,
    /// Ways to end in one or two blocks.
    pub(super) endings: Endings,
    coefficients: usize,
    lanes: usize,
}

impl BlockTable {
    /// Precomputes for `resins`, index `[resin][channel]`, all on one frequency grid.
    ///
    /// # Errors
    /// Options out of range, contradictory limits, resins that differ in channels or coefficients.
    pub fn new(resins: &[Vec<KubelkaMunk>], options: &SearchOptions) -> Result<Self, SearchError> {
        let limits = options.validate(resins.len())?;
        let channels = resins.first().map_or(0, Vec::len);
        let coefficients = resins.first().and_then(|resin| resin.first()).map_or(0, KubelkaMunk::len);
        if coefficients == 0 {
            let (resin, channel) = (ResinId(0), ChannelId(0));
            return Err(SearchError::Resins { resin, channel, found: 0, expected: 1 });
        }
        for (resin, parameters) in resins.iter().enumerate() {
            for channel in 0..channels.max(parameters.len()) {
                let found = if channel < channels { parameters.get(channel).map_or(0, KubelkaMunk::len) } else { 0 };
                if found != coefficients {
                    let (resin, channel) = (ResinId(resin), ChannelId(channel));
                    return Err(SearchError::Resins { resin, channel, found, expected: coefficients });
                }
            }
        }
        let lanes = (coefficients * channels).next_multiple_of(CHUNK);
        let interleave = |per_channel: &[Vec<f64>], pad: f64| interleave(per_channel, lanes, pad);
        let unit_mm = options.unit_mm();
        let sizes: Vec<usize> = (0..).map(|power| 1 << power).take_while(|size| *size <= options.units).collect();

        let base: Vec<Vec<f64>> = match options.core {
            Some(core) => resins[core.0].iter().map(KubelkaMunk::half_space).collect(),
            None => vec![vec![0.0; coefficients]; channels],
        };
        let block = |resin: &[KubelkaMunk], size: usize| {
            let (r, t): (Vec<_>, Vec<_>) = resin
                .iter()
                .map(|channel| channel.slab(size as f64 * unit_mm))
                .map(|slab| (slab.reflection, slab.transmission))
                .unzip();
            let (r, t) = (interleave(&r, 0.0), interleave(&t, 1.0));
            let det = r.iter().zip(&t).map(|(r, t)| t * t - r * r).collect();
            Block { r, t, det }
        };
        let blocks: Vec<Vec<Block>> =
            resins.iter().map(|resin| sizes.iter().map(|&size| block(resin, size)).collect()).collect();

        let mut darkest = vec![vec![0.0; lanes]; options.units + 1];
        let mut brightest = darkest.clone();
        for (channel, base) in base.iter().enumerate() {
            let parameters: Vec<&KubelkaMunk> = resins.iter().map(|resin| &resin[channel]).collect();
            let range = envelope(&parameters, base, options.units, unit_mm);
            for u in 0..=options.units {
                for i in 0..coefficients {
                    darkest[u][i * channels + channel] = range.darkest[u][i];
                    brightest[u][i * channels + channel] = range.brightest[u][i];
                }
            }
        }
        let base = interleave(&base, 0.0);
        let over_base = |block| over(block, &base);
        let block_over_base = blocks.iter().map(|sizes| sizes.iter().map(over_base).collect()).collect();
        let mut table = Self {
            options: options.clone(),
            limits,
            resins: resins.to_vec(),
            sizes,
            blocks,
            base,
            block_over_base,
            darkest,
            brightest,
            endings: Endings { endings: Vec::new(), boxes: Vec::new() },
            coefficients,
            lanes,
        };
        table.endings = Endings::new(&table);
        Ok(table)
    }

    /// The options the table was made with.
    pub fn options(&self) -> &SearchOptions {
        &self.options
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.resins[0].len()
    }

    /// Number of coefficients per channel.
    pub fn coefficients(&self) -> usize {
        self.coefficients
    }

    /// R̂ of a block on something that reflects `below`, by lane.
    pub(super) fn over(&self, resin: usize, size: usize, below: &[f64]) -> Vec<f64> {
        over(&self.blocks[resin][size], below)
    }

    pub(super) fn lanes(&self) -> usize {
        self.lanes
    }

    /// Whether a stacking of `total` units whose last layer is `run` units of `resin` may end there.
    ///
    /// A last layer of the core's resin is the core's: it is exempt from min-mm and max-mm, and the stacking without it
    /// is the one that counts. So it never ends one.
    pub(super) fn may_end(&self, resin: usize, run: usize, total: usize) -> bool {
        self.options.core != Some(ResinId(resin)) && run >= self.limits[resin].least && self.core_may_start(total)
    }

    /// Whether the core's own min-depth lets it start below `total` units.
    pub(super) fn core_may_start(&self, total: usize) -> bool {
        self.options.core.is_none_or(|core| total >= self.limits[core.0].top)
    }

    /// The target as lanes, checked.
    pub(super) fn goal(&self, target: &SearchTarget) -> Result<Goal, SearchError> {
        let channels = self.channels();
        let unlike = target.channels.iter().find(|channel| channel.len() != self.coefficients);
        if target.channels.len() != channels || unlike.is_some() {
            return Err(SearchError::Target {
                channels: target.channels.len(),
                coefficients: unlike.map_or(self.coefficients, Vec::len),
                expected_channels: channels,
                expected_coefficients: self.coefficients,
            });
        }
        for (channel, values) in target.channels.iter().enumerate() {
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                return Err(SearchError::TargetValue { channel: ChannelId(channel), index, found: values[index] });
            }
        }
        let weight: Vec<_> = target.channels.iter().map(|channel| self.options.objective.weights(channel)).collect();
        Ok(Goal { target: interleave(&target.channels, self.lanes, 0.0), weight: interleave(&weight, self.lanes, 0.0) })
    }

    /// Joins blocks, top first, to a stacking without a tail of the core's resin.
    pub(super) fn stacking(&self, blocks: impl Iterator<Item = (usize, usize)>) -> Stack {
        let unit_mm = self.options.unit_mm();
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for (resin, units) in blocks {
            match runs.last_mut() {
                Some(last) if last.0 == resin => last.1 += units,
                _ => runs.push((resin, units)),
            }
        }
        if runs.last().is_some_and(|run| self.options.core == Some(ResinId(run.0))) {
            runs.pop();
        }
        let layers = runs.into_iter().map(|(resin, units)| (ResinId(resin), units as f64 * unit_mm));
        Stack::joined(layers).over(self.options.core)
    }

    /// The finished answer: objective and reflection recomputed from whole layers in closed form.
    pub(super) fn answer(&self, stacking: Stack, target: &SearchTarget, nodes: u64) -> Match {
        let under_surface = |inside: Vec<f64>| self.options.surface.surface_over(&inside);
        let reflection: Vec<_> = reflection_of(&self.resins, &stacking).into_iter().map(under_surface).collect();
        let objective = self.options.objective.of(&reflection, target);
        Match { stacking, objective, reflection, bound: objective, proven: true, nodes }
    }
}

/// R̂ of a block on something that reflects `below`, by lane.
fn over(block: &Block, below: &[f64]) -> Vec<f64> {
    let lane = |((r, t), below): ((&f64, &f64), &f64)| r + t * t * below / (1.0 - r * below).max(f64::MIN_POSITIVE);
    block.r.iter().zip(&block.t).zip(below).map(lane).collect()
}

/// `[channel][coefficient]` to lanes.
fn interleave(per_channel: &[Vec<f64>], lanes: usize, pad: f64) -> Vec<f64> {
    let channels = per_channel.len();
    let mut flat = vec![pad; lanes];
    for (channel, values) in per_channel.iter().enumerate() {
        for (i, value) in values.iter().enumerate() {
            flat[i * channels + channel] = *value;
        }
    }
    flat
}
