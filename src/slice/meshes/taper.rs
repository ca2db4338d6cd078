//! Layers thinner than the pitch, rounded to the pitch or to nothing.
//!
//! Where a layer tapers off, nodes meet it only here and there once it is thinner than their distance: it would break
//! up into islands, whose volume marching cubes draws far too small (a lone node gets 1/6 of its cell). So a layer
//! thinner than half the pitch ends, its neighbours share it; one between half and a whole pitch is drawn a pitch thick
//! at their cost. Along a taper the two make up for each other: ∫ h dh over 0 … p is p · p/2. The outermost layer gives
//! to and takes from the one below, so that the outer surface stays.
//!
//! Does nothing where every layer is at least a pitch thick; a thick layer loses at most half a pitch on either side. A
//! layer below the pitch that does *not* taper is drawn too thick, or not at all: the pitch is too coarse for it.

/// Layers thinner than the pitch by no more than this share are left alone: rounding of depths.
const SAME: f32 = 1e-4;

/// Adjacent slots of one label.
#[derive(Debug, Clone, Copy)]
struct Run {
    label: u8,
    /// First slot; the run ends where the next one begins.
    first: usize,
    /// Depth at which it ends, mm.
    bottom: f32,
    /// It has been given its thickness.
    settled: bool,
}

/// Rounds rows; holds buffers.
#[derive(Debug, Default)]
pub struct Tapers {
    runs: Vec<Run>,
}

impl Tapers {
    /// Rounds the slots' bottoms in `row` (ascending); `labels` are theirs, then the core's.
    pub fn round(&mut self, labels: &[u8], pitch: f32, row: &mut [f32]) {
        if !is_thin(row, pitch) {
            return;
        }
        self.collect(labels, row);
        while let Some(index) = self.thinnest(pitch) {
            if self.thickness(index) < 0.5 * pitch {
                self.end(index);
            } else {
                self.thicken(index, pitch);
            }
        }
        let mut runs = self.runs.iter().peekable();
        let mut bottom = 0.0;
        for (slot, depth) in row.iter_mut().enumerate() {
            while let Some(run) = runs.next_if(|run| run.first <= slot) {
                bottom = run.bottom;
            }
            *depth = bottom;
        }
    }

    /// The runs that have a thickness, then the core's.
    fn collect(&mut self, labels: &[u8], row: &[f32]) {
        self.runs.clear();
        let mut top = 0.0;
        for (first, (&label, bottom)) in labels.iter().zip(row.iter().copied().chain([f32::INFINITY])).enumerate() {
            if bottom <= top {
                continue;
            }
            match self.runs.last_mut() {
                Some(run) if run.label == label => run.bottom = bottom,
                _ => self.runs.push(Run { label, first, bottom, settled: false }),
            }
            top = bottom;
        }
    }

    fn top(&self, index: usize) -> f32 {
        if index == 0 { 0.0 } else { self.runs[index - 1].bottom }
    }

    fn thickness(&self, index: usize) -> f32 {
        self.runs[index].bottom - self.top(index)
    }

    /// The thinnest run that needs rounding.
    fn thinnest(&self, pitch: f32) -> Option<usize> {
        let thin = |&index: &usize| !self.runs[index].settled && self.thickness(index) < pitch * (1.0 - SAME);
        (0..self.runs.len()).filter(thin).min_by(|&a, &b| self.thickness(a).total_cmp(&self.thickness(b)))
    }

    /// Gives a run to its neighbours, and joins these if they are of one label.
    fn end(&mut self, index: usize) {
        let run = self.runs.remove(index);
        if index == 0 {
            return; // the one below now begins at the surface
        }
        let top = self.top(index);
        self.runs[index - 1].bottom = 0.5 * (top.min(run.bottom) + run.bottom);
        if self.runs.get(index).is_some_and(|below| below.label == self.runs[index - 1].label) {
            let below = self.runs.remove(index);
            self.runs[index - 1].bottom = below.bottom;
            self.runs[index - 1].settled = false;
        }
    }

    /// Makes a run a pitch thick at the cost of its neighbours, as far as they have not been settled.
    fn thicken(&mut self, index: usize, pitch: f32) {
        self.runs[index].settled = true;
        let missing = pitch - self.thickness(index);
        let free = |run: Option<&Run>| run.is_some_and(|run| !run.settled);
        let above = index > 0 && free(self.runs.get(index - 1));
        let below = free(self.runs.get(index + 1));
        let (up, down) = match (above, below) {
            (true, true) => (0.5 * missing, 0.5 * missing),
            (true, false) => (missing, 0.0),
            (false, true) => (0.0, missing),
            (false, false) => return,
        };
        if index > 0 {
            let highest = if index > 1 { self.runs[index - 2].bottom } else { 0.0 };
            self.runs[index - 1].bottom = (self.runs[index - 1].bottom - up).max(highest);
        }
        let lowest = self.runs.get(index + 1).map_or(f32::INFINITY, |run| run.bottom);
        self.runs[index].bottom = (self.runs[index].bottom + down).min(lowest);
    }
}

/// Whether some slot of a row has a thickness below the pitch.
pub fn is_thin(row: &[f32], pitch: f32) -> bool {
    let mut top = 0.0;
    row.iter().any(|&bottom| {
        let thickness = bottom - std::mem::replace(&mut top, bottom);
        thickness > 0.0 && thickness < pitch * (1.0 - SAME)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LABELS: [u8; 6] = [1, 2, 3, 1, 2, 4];

    fn rounded(row: &[f32], pitch: f32) -> Vec<f32> {
        let mut row = row.to_vec();
        Tapers::default().round(&LABELS, pitch, &mut row);
        row
    }

    #[test]
    fn thin_layers_end_or_become_a_pitch_thick() {
        // The fourth is white like the first, so that where both between them end they join.
        assert_eq!(rounded(&[0.5, 0.54, 1.0, 1.5, 2.0], 0.1), [0.52, 0.52, 1.0, 1.5, 2.0]);
        let grown = rounded(&[0.5, 0.58, 1.0, 1.5, 2.0], 0.1);
        assert!((grown[0] - 0.49).abs() < 1e-6 && (grown[1] - 0.59).abs() < 1e-6);
        assert_eq!(rounded(&[0.5, 0.52, 0.54, 1.5, 2.0], 0.1), [1.5, 1.5, 1.5, 1.5, 2.0]);
        assert_eq!(rounded(&[0.03, 0.5, 1.0, 1.5, 2.0], 0.1), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(rounded(&[0.08, 0.5, 1.0, 1.5, 2.0], 0.1), [0.1, 0.5, 1.0, 1.5, 2.0]);
    }

    #[test]
    fn a_taper_keeps_its_volume() {
        let steps = 4000;
        let mean = |of: &dyn Fn(f32) -> f32| {
            (0..steps).map(|n| f64::from(of(0.3 * (n as f32 + 0.5) / steps as f32))).sum::<f64>() / f64::from(steps)
        };
        let thickness = |h: f32| {
            let row = rounded(&[1.0, 1.0 + h, 2.0, 3.0, 4.0], 0.1);
            row[1] - row[0]
        };
        assert!((mean(&thickness) / mean(&|h| h) - 1.0).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn rows_stay_ascending_and_thick_ones_as_they_are(thickness in prop::collection::vec(0.0_f32..0.4, 5)) {
            let mut depth = 0.0;
            let row: Vec<f32> = thickness.iter().map(|h| { depth += h; depth }).collect();
            let out = rounded(&row, 0.1);
            prop_assert!(out.is_sorted() && out[0] >= 0.0, "{:?} {:?}", row, out);
            if thickness.iter().all(|&h| h >= 0.1) {
                prop_assert_eq!(&out, &row);
            }
            // A layer twice as thick as the pitch keeps its middle, whatever lies around it.
            let label = |row: &[f32], depth: f32| LABELS[row.iter().filter(|bottom| depth >= **bottom).count()];
            let mut top = 0.0;
            for (&bottom, label_here) in row.iter().zip(LABELS) {
                let middle = top + 0.1001..bottom - 0.1001;
                top = bottom;
                for depth in [middle.start, middle.end].into_iter().filter(|_| !middle.is_empty()) {
                    prop_assert_eq!(label(&out, depth), label_here, "{:?} {:?} at {}", &row, &out, depth);
                }
            }
        }
    }
}
