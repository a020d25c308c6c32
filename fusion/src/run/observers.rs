//! The observers of a run.

use super::faults::{fault_windows, outages};
use super::files::{Files, thinning};
use super::sections::{Computation, Current, Detector, Identity, JudgedBy};
use super::smoothing::Planned;
use super::{Finding, Run};
use crate::config::Diagnostics;
use crate::health::HealthRecord;
use crate::observe::{
    ConsumerCounts, Consumers, Counters, Excess, Excesses, Failures, Filters, Finals, Heard, Hub, Hypotheses, InsideScores, RunObserver,
    RunStart, SectionObserver, Smoothed, Smoother, Starts, Statistics, UnusedRows, at_end, linked, made_or,
};
use crate::score::{Comparison, Outage, Rules, Score};

type Boxed<'a> = Box<dyn SectionObserver + 'a>;

/// The observers that make the sections of the result, in the order of summary.json.
fn of_sections<'a>(start: &RunStart<'_>, smoother: Option<Smoother<'a>>) -> Vec<Boxed<'a>> {
    let filters = start.filters;
    let is_alone = !start.is_one_of_many;
    let has_bank = start.design.filter.bank.is_some();
    let disturbable = start.rows.disturbable();
    let mut all: Vec<Boxed<'a>> = vec![
        at_end(Identity::of),
        // The findings are made of all other sections.
        at_end(|_| Vec::<Finding>::new()),
        at_end(|end| Computation::of(end.design)),
        Box::new(HealthRecord::new(filters, start.assembly, start.outages)),
        Box::new(Starts::default()),
        at_end(|end| {
            let tested = end.assembly.runner.tested().into_iter();
            tested.map(Detector::from).collect::<Vec<_>>()
        }),
        Box::new(Counters::default()),
        made_or(has_bank.then(Hypotheses::default), None::<Hypotheses>),
        at_end(|end| JudgedBy::of(end.design)),
        made_or(filters.outermost().and_then(|filter| start.score(filter)), None::<Score>),
        made_or(smoother, None::<Smoothed>),
        at_end(Current::of),
        Box::new(InsideScores::new(start)),
        at_end(fault_windows),
        at_end(|end| end.rows.record()),
        Box::new(Statistics::new(filters, start.counts_from(), &disturbable)),
        made_or(is_alone.then(|| Excesses::new(filters)), Vec::<Excess>::new()),
        at_end(|end| end.rows.statistics()),
        Box::new(if is_alone { Finals::new(filters) } else { Finals::of_outermost() }),
        made_or(
            is_alone.then(|| Consumers::new(&start.assembly.runner)),
            Vec::<ConsumerCounts>::new(),
        ),
        Box::new(UnusedRows::default()),
    ];
    if is_alone {
        all.extend(linked(start).into_iter().map(|observer| -> Boxed<'a> { observer }));
    }
    all.push(Box::new(Failures::default()));
    all
}

impl Run<'_> {
    /// A hub with all observers that make the result and its files; `smoothed` observe the smoothed estimates.
    pub(super) fn hub<'h>(
        &mut self,
        filters: &'h Filters,
        (planned, files): (Option<Planned>, &'h mut Files),
        smoothed: &'h mut [&mut dyn RunObserver],
    ) -> Result<Hub<'h>, Diagnostics> {
        let outages = outages(self.design, &self.assembly);
        let rules: Vec<Rules> = filters.iter().filter_map(|filter| self.rules(filter, &outages)).collect();
        let comparison = self.data.reference.comparison();
        let start = RunStart {
            design: self.design,
            assembly: &self.assembly,
            filters,
            is_one_of_many: self.is_one_of_many,
            rows: &*self.data.rows,
            outages: &outages,
            rules: &rules,
        };
        let smoother = match planned {
            None => None,
            Some(planned) => {
                let by = planned.by(self.design, &self.assembly, files)?;
                let mut hub = Hub::new(filters, comparison.as_ref().map(Comparison::emptied).as_ref());
                let score = filters.outermost().and_then(|filter| start.score(filter));
                score.into_iter().for_each(|score| hub.add_section(Box::new(score)));
                smoothed.iter_mut().for_each(|observer| hub.add(*observer));
                let rows = files.smoothed.is_some().then(|| thinning(self.design));
                files.smoothed.iter_mut().for_each(|file| hub.add(file));
                files.also_smoothed.iter_mut().for_each(|file| hub.add(file));
                Some(Smoother::new(by, hub, rows, self.assembly.runner.belief().clone()))
            }
        };
        let mut hub = Hub::new(filters, comparison.as_ref());
        of_sections(&start, smoother)
            .into_iter()
            .for_each(|observer| hub.add_section(observer));
        files.estimates.iter_mut().for_each(|file| hub.add(file));
        files.updates.iter_mut().for_each(|file| hub.add(file));
        // They have the estimates of estimates.csv.
        let mut also = files.also.iter_mut();
        if !self.options.causal || self.assembly.runner.rewinds().is_none() {
            also.by_ref().for_each(|file| hub.add(file));
        }
        if self.assembly.runner.rewinds().is_some() {
            let mut current = Hub::new(filters, comparison.as_ref());
            also.for_each(|file| current.add(file));
            let score = filters.outermost().and_then(|filter| start.score_without_outages(filter));
            score.into_iter().for_each(|score| current.add_section(Box::new(score)));
            files.current.iter_mut().for_each(|file| current.add(file));
            hub.add_current(current);
        }
        Ok(hub)
    }

    /// How `filter` is scored; `None` without a reference.
    fn rules(&self, filter: &Heard, outages: &[Outage]) -> Option<Rules> {
        let reference = Some(&self.data.reference).filter(|reference| !reference.is_empty())?;
        let declared = if filter.is_outermost() { outages } else { &[] };
        Some(reference.rules(self.design, &filter.layout, declared, self.is_one_of_many))
    }
}
