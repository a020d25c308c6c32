//! The health of a run: a line at the top, and the periods of ill health.

use fusion::health::{FilterHealth, NamedReason, State, Transition};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Section, Table};

/// Spells of ill health that are listed.
const SPELLS: usize = 20;
/// Reasons that are named in a line.
const REASONS: usize = 4;

/// One line: the state at the end, and the time in each state that is not good. If the filter was always good, the line
/// has the reasons that were reported nevertheless.
pub(super) fn line(health: &FilterHealth) -> String {
    let ill = [State::Lost, State::Degraded, State::Coasting].into_iter();
    let ill: Vec<String> = ill
        .filter(|s| health.spent.of(*s) > 0.0)
        .map(|s| format!("{s} for {:.1} s", health.spent.of(s)))
        .collect();
    let declared = if health.is_ill_as_declared() {
        format!(" of {:.1} s, all within declared outages or just after them", health.spent.total())
    } else if health.in_outages > 0.0 {
        format!(", {:.1} s of it within declared outages or just after them", health.in_outages)
    } else {
        String::new()
    };
    match (health.is_good(), ill.is_empty()) {
        (true, true) => match health.transitions.iter().find(|t| !t.reasons.is_empty()) {
            // Several reasons in turn are shown as one period.
            Some(told) => match health.spells().iter().rev().find(|s| !s.reasons.is_empty()) {
                Some(spell) if spell.told_until < health.until => {
                    format!("good; from {:.1} to {:.1} s: {}", told.time, spell.told_until, named(&told.reasons))
                }
                _ => format!("good; from {:.1} s on: {}", told.time, named(&told.reasons)),
            },
            None => "good".to_owned(),
        },
        (_, true) => at_the_end(health),
        _ => format!("{}{declared}; {}", ill.join(", "), at_the_end(health)),
    }
}

/// The state at the end. If the log ends with missing input, the text says so.
fn at_the_end(health: &FilterHealth) -> String {
    let last = health.transitions.last().filter(|_| health.further_transitions == 0);
    let is_end_of_input = |t: &&Transition| t.state == State::Coasting && t.reasons.iter().all(|r| r.reason == "no_input");
    match last.filter(is_end_of_input) {
        Some(last) => format!(
            "{} for the last {:.1} s, for the input of the process ends before the other rows do",
            health.state,
            (health.until - last.time).max(0.0)
        ),
        None => format!("{} at the end", health.state),
    }
}

/// When and why it first was worse than coasting, apart from declared outages.
pub(super) fn first_ill(health: &FilterHealth) -> Option<String> {
    if health.is_ill_as_declared() {
        return None;
    }
    let spells = health.spells();
    // If there were more changes than are kept, the period may be missing here.
    let undeclared = spells.iter().find(|s| s.is_ill_undeclared());
    let first = undeclared.or_else(|| spells.iter().find(|s| s.state >= State::Degraded))?;
    Some(format!("{} from {:.1} s on: {}", first.state, first.from, named(&first.reasons)))
}

/// A sentence for each filter that was not in good health.
pub(super) fn warnings(all: &[FilterHealth]) -> impl Iterator<Item = String> {
    let ill = all.iter().filter(|h| h.spent.degraded + h.spent.lost > 0.0);
    ill.filter_map(|health| {
        let first = first_ill(health)?;
        let whose = match health.filter.as_str() {
            "" => String::new(),
            name => format!(" of `{name}`"),
        };
        Some(format!("health{whose}: {first} ({})", line(health)))
    })
}

/// The first few reasons.
fn named(reasons: &[NamedReason]) -> String {
    first(reasons, REASONS)
}

/// The first `most` reasons. A reason that holds for two states is shown once, with the worse state.
fn first(reasons: &[NamedReason], most: usize) -> String {
    let is_worse = |a: &NamedReason, b: &NamedReason| (a.reason, &a.of) == (b.reason, &b.of) && a.state > b.state;
    let kept: Vec<&NamedReason> = reasons.iter().filter(|r| !reasons.iter().any(|other| is_worse(other, r))).collect();
    let mut named = kept.iter().take(most).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if kept.len() > most {
        named += &format!(" and {} more", kept.len() - most);
    }
    named
}

/// The share of the time that each spent in each state, and the state at the end; `what` they are.
pub(super) fn shares<'a>(what: &str, all: impl IntoIterator<Item = (&'a str, &'a FilterHealth)>) -> Table {
    let columns = State::ALL.map(|s| Column::number(s.word()));
    let mut t = Table::new([Column::text(what)].into_iter().chain(columns).chain([Column::text("at the end")]));
    for (name, health) in all.into_iter().filter(|(_, h)| h.spent.total() > 0.0) {
        let shares = State::ALL.map(|s| Cell::Share(health.spent.of(s) / health.spent.total()));
        let end = Cell::text(health.state.word());
        t.row([Cell::text(name)].into_iter().chain(shares).chain([end]));
    }
    t
}

/// The periods of ill health with their first few reasons. Filters that were good since they aligned are left out.
#[must_use]
pub fn section(all: &[FilterHealth]) -> Section {
    spells(all, REASONS)
}

/// The same with all reasons.
#[must_use]
pub(super) fn whole(all: &[FilterHealth]) -> Section {
    spells(all, usize::MAX)
}

fn spells(all: &[FilterHealth], most: usize) -> Section {
    let ill = || all.iter().filter(|h| !h.is_good() && !h.transitions.is_empty());
    fn name(health: &FilterHealth) -> &str {
        if health.filter.is_empty() {
            "the design's own"
        } else {
            &health.filter
        }
    }
    let mut t = Table::new([
        Column::text("filter"),
        Column::with_unit("from", Unit::of_si("s")),
        Column::with_unit("for", Unit::of_si("s")),
        Column::text("health"),
        Column::text("because"),
    ]);
    let mut notes = Vec::new();
    for health in ill() {
        let spells = health.spells();
        for spell in spells.iter().take(SPELLS) {
            let times = [spell.from, spell.to - spell.from].map(Cell::Seconds);
            let reasons = first(&spell.reasons, most);
            let (is_late, is_over) = (spell.told > spell.from, spell.told_until < spell.to);
            let because = match (is_late, is_over) {
                _ if reasons.is_empty() => reasons,
                (true, true) => format!("from {:.1} to {:.1} s: {reasons}", spell.told, spell.told_until),
                (true, false) => format!("from {:.1} s on: {reasons}", spell.told),
                (false, true) => format!("until {:.1} s: {reasons}", spell.told_until),
                (false, false) => reasons,
            };
            let words = [Cell::text(spell.state.word()), Cell::text(because)];
            t.row([Cell::text(name(health))].into_iter().chain(times).chain(words));
        }
        if spells.len() > SPELLS {
            notes.push(format!(
                "The first {SPELLS} of {} are listed; summary.json has them all.",
                spells.len()
            ));
        }
        if health.further_transitions > 0 {
            notes.push(format!("{} further changes were not kept.", health.further_transitions));
        }
    }
    Section {
        notes,
        ..Section::new("Health", [shares("filter", ill().map(|h| (name(h), h))), t])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_that_ends_with_its_input_is_no_filter_that_coasts() {
        let at_the_end = |reason: &'static str| {
            let coasting = NamedReason {
                reason,
                of: String::new(),
                state: State::Coasting,
            };
            line(&FilterHealth {
                state: State::Coasting,
                until: 99.9,
                transitions: vec![Transition {
                    time: 99.3,
                    state: State::Coasting,
                    reasons: vec![coasting],
                    in_outages: 0.0,
                }],
                ..FilterHealth::default()
            })
        };
        assert_eq!(
            at_the_end("no_input"),
            "coasting for the last 0.6 s, for the input of the process ends before the other rows do"
        );
        assert_eq!(at_the_end("silent"), "coasting at the end");
    }

    #[test]
    fn a_reason_that_came_later_than_a_state_is_told_with_its_time() {
        let change = |time, state, reasons| Transition {
            time,
            state,
            reasons,
            in_outages: 0.0,
        };
        let silent = |state| NamedReason {
            reason: "silent",
            of: "vel".to_owned(),
            state,
        };
        let health = FilterHealth {
            worst: State::Degraded,
            until: 365.0,
            transitions: vec![
                change(132.3, State::Good, Vec::new()),
                change(329.0, State::Good, vec![silent(State::Good)]),
                change(329.3, State::Degraded, vec![silent(State::Degraded)]),
            ],
            ..FilterHealth::default()
        };
        let table = format!("{:?}", section(&[health]));
        assert!(
            table.contains("from 329.0 s on: `vel` silent") && table.matches(" s on: ").count() == 1,
            "{table}"
        );
    }

    #[test]
    fn a_reason_is_told_once_with_the_worse_of_its_states_and_all_of_them_where_all_is_asked_for() {
        let reason = |reason, of: &str, state| NamedReason {
            reason,
            of: of.to_owned(),
            state,
        };
        let mut all = vec![
            reason("silent", "gnss", State::Good),
            reason("silent", "gnss", State::Degraded),
            reason("silent", "log", State::Good),
        ];
        assert_eq!(named(&all), "`gnss` silent, `log` silent, and others measure what it does");
        all.extend(["a", "b", "c"].map(|of| reason("rejected", of, State::Degraded)));
        assert!(named(&all).ends_with("and 1 more") && first(&all, usize::MAX).ends_with("`c` rejected"));
    }

    #[test]
    fn what_declared_outages_explain_is_not_the_first_to_be_told() {
        let change = |time, state, in_outages| Transition {
            time,
            state,
            in_outages,
            ..Transition::default()
        };
        let mut health = FilterHealth {
            until: 300.0,
            in_outages: 39.2,
            transitions: vec![
                change(105.9, State::Degraded, 39.2),
                change(145.1, State::Good, 0.0),
                change(202.8, State::Degraded, 0.0),
                change(247.0, State::Good, 0.0),
            ],
            ..FilterHealth::default()
        };
        (health.spent.degraded, health.spent.good) = (83.4, 200.0);
        let first = |health: &FilterHealth| first_ill(health).unwrap();
        assert!(first(&health).starts_with("degraded from 202.8 s on"), "{}", first(&health));
        // A second of it is beyond the outage.
        health.transitions[0].in_outages = 38.2;
        assert!(first(&health).starts_with("degraded from 105.9 s on"), "{}", first(&health));
    }
}
