//! The stamps of messages: microseconds since the start of their sender.
//!
//! | the message has | its stamp |
//! |---|---|
//! | a time since the start, of 32 bits in milliseconds or microseconds | unwrapped next to the stamp before it |
//! | a time since the start, of 64 bits | that time |
//! | a time since 1970 | since the start by `SYSTEM_TIME` of its sender; without one, the first such time follows the stamp before it |
//! | no time, or zero | that of the newest message of its component, or else of its system |

use super::definition::{Form, Message};
use core::ops::Range;
use std::collections::HashMap;

/// Microseconds since 1970 of this century. No autopilot runs for thirty years.
pub(super) const CENTURY: Range<i64> = 946_684_800_000_000..4_102_444_800_000_000;

/// The clocks of all senders.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// By system and component.
    senders: HashMap<(u8, u8), Own>,
    /// The newest stamp of each system.
    systems: HashMap<u8, i64>,
}

/// The clock of a sender.
#[derive(Clone, Copy, Debug, Default)]
struct Own {
    newest: Option<i64>,
    /// Microseconds from 1970 to its start.
    start: Option<Start>,
}

#[derive(Clone, Copy, Debug)]
enum Start {
    /// From `SYSTEM_TIME`.
    Known(i64),
    Assumed(i64),
}

/// The field with the time of a message, and its microseconds a count.
fn time(message: &Message) -> Option<(usize, i64)> {
    const TIMES: [(&str, i64); 4] = [("time_usec", 1), ("time_boot_ms", 1000), ("usec", 1), ("time_boot_us", 1)];
    let named = |(name, scale): (&str, i64)| Some((field(message, name)?, scale));
    TIMES.into_iter().find_map(named)
}

fn field(message: &Message, name: &str) -> Option<usize> {
    message.fields.iter().position(|field| field.name == name)
}

impl Clock {
    /// The stamp of a message of system and component; `None` before the first time of its system.
    pub(super) fn stamp(&mut self, message: &Message, content: &[u8], sender: (u8, u8)) -> Option<i64> {
        let of_system = self.systems.get(&sender.0).copied();
        let own = self.senders.entry(sender).or_default();
        let before = own.newest.or(of_system);
        let read = |(field, scale): (usize, i64)| {
            let count = i64::try_from(message.whole(field, content)).ok()?.checked_mul(scale)?;
            let wraps = matches!(message.fields[field].form, Form::Unsigned(4)).then(|| scale << 32);
            (count != 0 && count < CENTURY.end).then_some((count, wraps))
        };
        let Some(found) = time(message).and_then(read) else { return before };
        let stamp = match found {
            (count, Some(period)) => unwrapped(count, period, own.newest),
            (count, None) if count < CENTURY.start => count,
            (count, None) => {
                let assumed = count - before.unwrap_or(0);
                let (Start::Known(start) | Start::Assumed(start)) = *own.start.get_or_insert(Start::Assumed(assumed));
                count - start
            }
        };
        let unix = field(message, "time_unix_usec").and_then(|field| i64::try_from(message.whole(field, content)).ok());
        if let (Some(unix), None | Some(Start::Assumed(_))) = (unix.filter(|unix| CENTURY.contains(unix)), own.start) {
            own.start = Some(Start::Known(unix - stamp));
        }
        own.newest = Some(stamp);
        self.systems.insert(sender.0, stamp);
        Some(stamp)
    }
}

/// A count that begins anew after `period`: the time nearest to the one before it.
fn unwrapped(count: i64, period: i64, before: Option<i64>) -> i64 {
    let periods = before.map_or(0, |before| (before - count + period / 2).div_euclid(period));
    count + period * periods.max(0)
}
