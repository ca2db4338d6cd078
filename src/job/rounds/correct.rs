//! Round after round, until no other helps.

use std::time::Instant;

use super::{Factors, Judged, Prepared, Round, correction, factors, progress::is_worse};
use crate::{
    job::{
        RunError,
        plan::{CHANNELS, ObjectPlan},
        record::{Ended, RoundRecord, Rounds},
    },
    watch::Watch,
};

impl Prepared {
    /// Prints and corrects, round after round.
    pub(super) fn correct(
        &mut self,
        plans: &[ObjectPlan],
        sha256: String,
        watch: &dyn Watch,
    ) -> Result<Rounds, RunError> {
        let none = |plan: &ObjectPlan| vec![[0.0; CHANNELS]; plan.points.points().len()];
        let mut laid: Vec<Factors> = plans.iter().map(none).collect();
        let mut short_of: Vec<Vec<[f64; CHANNELS]>> = vec![Vec::new(); plans.len()];
        let mut before: Option<Round> = None;
        let mut spots = None;
        let rounds = self.job.rounds();
        let mut records = Records::new(rounds, watch);
        for round in 0..rounds {
            let started = Instant::now();
            let looked = self.look_at_print(plans, &mut spots, round, watch)?;
            let Judged { round: now, mut record, ends, next } =
                self.judge(plans, looked, laid, &short_of, before.as_ref());
            // After the last round no other would have followed.
            record.ended = ends.filter(|&ends| round + 1 < rounds || ends == Ended::Worse);
            records.add(record);
            if let Some(ends) = ends.filter(|&ends| ends != Ended::NothingLeft) {
                laid = now.laid;
                if let (Some(better), Ended::Worse) = (before.take(), ends) {
                    laid = better.laid;
                    self.lay_all_again(plans, &laid, watch)?;
                }
                self.took.rounds.push(started.elapsed());
                break;
            }
            before = Some(now);
            laid = plans.iter().zip(&next).map(|(plan, next)| factors(&correction(plan, next))).collect();
            short_of = self.lay_all_again(plans, &laid, watch)?;
            self.took.rounds.push(started.elapsed());
            // What little is left is laid, and needs no other round.
            if ends == Some(Ended::NothingLeft) {
                break;
            }
        }
        if let Some(before) = before {
            let started = Instant::now();
            let looked = self.look_at_print(plans, &mut spots, rounds, watch)?;
            if is_worse(&before.looked, &looked) {
                let Judged { record, .. } = self.judge(plans, looked, laid, &short_of, Some(&before));
                records.add_worse(record);
                laid = before.laid;
                self.lay_all_again(plans, &laid, watch)?;
            }
            if let Some(last) = self.took.rounds.last_mut() {
                *last += started.elapsed();
            }
        }
        let objects = plans.iter().zip(&laid).map(|(plan, factors)| correction(plan, factors)).collect();
        Ok(Rounds::new(sha256, records.finished(), objects))
    }
}

/// What the rounds found; each is told once it stays as it is.
struct Records<'a> {
    records: Vec<RoundRecord>,
    /// How many of them were told.
    told: usize,
    /// Rounds at most.
    of: u32,
    watch: &'a dyn Watch,
}

impl<'a> Records<'a> {
    fn new(of: u32, watch: &'a dyn Watch) -> Self {
        Self { records: Vec::new(), told: 0, of, watch }
    }

    fn tell(&mut self) {
        for (number, record) in (1..).zip(&self.records).skip(self.told) {
            record.tell(number, self.of, self.watch);
        }
        self.told = self.records.len();
    }

    fn add(&mut self, record: RoundRecord) {
        // Whether nothing is left shows when the print is looked at for the last time.
        let stays = record.ended != Some(Ended::NothingLeft);
        self.records.push(record);
        if stays {
            self.tell();
        }
    }

    /// Adds the look after the last round, which found the print farther off.
    fn add_worse(&mut self, record: RoundRecord) {
        self.records.iter_mut().for_each(|record| record.ended = None);
        self.add(RoundRecord { ended: Some(Ended::Worse), ..record });
    }

    fn finished(mut self) -> Vec<RoundRecord> {
        self.tell();
        self.records
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use serde_json::Value;

    use super::*;

    #[derive(Default)]
    struct Heard(Mutex<Vec<Value>>);

    impl Watch for Heard {
        fn found(&self, _what: &'static str, details: Value) {
            self.0.lock().unwrap().push(details);
        }
    }

    impl Heard {
        fn rounds(&self) -> Vec<(u64, u64, Option<String>)> {
            let told = self.0.lock().unwrap();
            let number = |event: &Value, key: &str| event[key].as_u64().unwrap();
            let ended = |event: &Value| event.get("ended").map(|ended| ended.as_str().unwrap().to_owned());
            told.iter().map(|event| (number(event, "round"), number(event, "of"), ended(event))).collect()
        }
    }

    fn record(ended: Option<Ended>) -> RoundRecord {
        RoundRecord { points: 1, walks: 1, fit: Vec::new(), worst: 0.0, out_of_reach: 0.0, ended }
    }

    /// That the last look takes back why a round was the last one is not told first and taken back then.
    #[test]
    fn rounds_are_told_as_they_are_written() {
        for last_is_worse in [false, true] {
            let heard = Heard::default();
            let mut records = Records::new(4, &heard);
            records.add(record(None));
            records.add(record(Some(Ended::NothingLeft)));
            assert_eq!(heard.rounds(), [(1, 4, None)]);
            if last_is_worse {
                records.add_worse(record(None));
            }
            let written = records.finished();
            let ends: Vec<_> = heard.rounds().into_iter().map(|(_, _, ended)| ended).collect();
            match last_is_worse {
                false => assert_eq!(ends, [None, Some("nothing-left".to_owned())]),
                true => assert_eq!(ends, [None, None, Some("worse".to_owned())]),
            }
            assert_eq!(heard.rounds().iter().map(|(number, ..)| *number).collect::<Vec<_>>(), [1, 2, 3][..ends.len()]);
            assert_eq!(written.len(), ends.len());
        }
    }
}
