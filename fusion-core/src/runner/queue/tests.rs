//! The queue alone: rows in, and out again in order of their time of validity.

use super::*;
use crate::memory::{restore, save};
use crate::runner::consumer::{Consumer, Delays, Refused, Route};
use crate::runner::{Discard, Port, Row, StreamId};
use crate::time::Time;
use proptest::prelude::*;

/// How far rows may arrive out of order [ms].
const BUFFER: i64 = 100;

fn ms(ms: i64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

/// The consumers with their streams and delays [ms]. One of them reads every stream but the last.
const CONSUMERS: [(Consumer, StreamId, i64); 6] = [
    (Consumer::Input, 0, 0),
    (Consumer::Initialiser(0, 0), 1, 30),
    (Consumer::Stage(0, 0), 0, 10),
    (Consumer::Stage(0, 1), 1, 0),
    (Consumer::Sensor(1, 0), 1, 70),
    (Consumer::Sensor(0, 1), 2, -20),
];

/// Three streams of one number each.
fn queue() -> Queue {
    let mut queue = Queue::new(BUFFER * 1_000_000);
    for name in ["a", "b", "c"] {
        queue.add_stream(name, 1);
    }
    let route = |(consumer, stream, delay): (Consumer, StreamId, i64)| Route {
        consumer,
        port: Port {
            stream,
            columns: vec![0],
            delay: delay * 1_000_000,
        },
        takes_late: false,
    };
    let delays = Delays {
        longest: 70_000_000,
        ..Delays::default()
    };
    queue.connect(CONSUMERS.map(route).to_vec(), delays);
    queue
}

/// Served rows: when each is valid, for which consumer, and its number.
type Served = Vec<(Time, Consumer, u64)>;

/// Serves the rows that are valid up to `until`.
fn serve(queue: &mut Queue, until: Time, served: &mut Served) {
    while queue.next(until).is_some() {
        let entry = queue.take().unwrap();
        served.push((entry.time, entry.consumer, queue.row(entry.row).id(&[]).number));
        queue.release(entry.row);
    }
}

/// Feeds row number `number`, stamped at `stamp` [ms], and serves what is due.
fn feed(queue: &mut Queue, number: usize, (stream, stamp): (StreamId, i64), served: &mut Served) -> Vec<Refused> {
    let row = Row {
        number: number as u64,
        ..Row::new(stream, ms(stamp), &[0.0])
    };
    let mut all = Vec::new();
    queue.note(row.time);
    let put = queue.put(&row, queue.watermark(), Time::MIN, |refused| {
        all.push(refused);
        Ok::<(), ()>(())
    });
    put.unwrap();
    // The samples of the input cover any time: rows that are ahead of it wait.
    let (due, _) = queue.due(&row, i64::MAX / 4);
    serve(queue, due, served);
    all
}

/// When each row is valid, for each of its consumers.
fn sorted(rows: &[(StreamId, i64)]) -> Served {
    let mut all = Vec::new();
    for (number, (stream, stamp)) in rows.iter().enumerate() {
        let consumers = CONSUMERS.iter().filter(|(_, of, _)| of == stream);
        all.extend(consumers.map(|(consumer, _, delay)| (ms(stamp - delay), *consumer, number as u64)));
    }
    all.sort_unstable();
    all
}

fn is_empty(queue: &Queue) -> bool {
    queue.next(Time::MAX).is_none() && (0..1000).all(|at| !queue.holds(at))
}

proptest! {
    #[test]
    fn any_order_of_arrival_within_the_buffer_is_served_in_order_of_validity(
        rows in prop::collection::vec((0_usize..3, 0..BUFFER), 1..200),
        cut in 0_usize..200,
    ) {
        // Stamps are 5 ms apart.
        let stamped: Vec<(StreamId, i64)> = rows.iter().zip(0..).map(|((stream, _), k)| (*stream, 5 * k)).collect();
        let mut arrivals: Vec<usize> = (0..rows.len()).collect();
        arrivals.sort_by_key(|&k| stamped[k].1 + rows[k].1);
        let (mut queue, mut served) = (queue(), Served::new());
        for (position, &k) in arrivals.iter().enumerate() {
            if position == cut {
                // Another queue continues.
                let (mut bytes, mut twin) = (Vec::new(), self::queue());
                save(&mut queue, &mut bytes);
                restore(&mut twin, &bytes).unwrap();
                queue = twin;
            }
            prop_assert_eq!(feed(&mut queue, k, stamped[k], &mut served), vec![]);
        }
        serve(&mut queue, Time::MAX, &mut served);
        prop_assert_eq!(served, sorted(&stamped));
        prop_assert!(is_empty(&queue));
    }
}

#[test]
fn a_row_later_than_the_buffer_is_refused_by_the_consumers_for_which_it_is_late() {
    let (mut queue, mut served) = (queue(), Served::new());
    for k in 0..101 {
        assert_eq!(feed(&mut queue, k, (0, 10 * k as i64), &mut served), vec![]);
    }
    // Rows are held back for 170 ms: 830 ms has been served. For the stage of stream 1 the row is valid at its stamp.
    let refused = feed(&mut queue, 999, (1, 840), &mut served);
    let who: Vec<_> = refused.iter().map(|r| (r.consumer, r.time)).collect();
    assert_eq!(who, [(Consumer::Initialiser(0, 0), ms(810)), (Consumer::Sensor(1, 0), ms(770))]);
    assert!(
        refused
            .iter()
            .all(|r| r.why == Discard::Late { now: ms(830) } && r.row.number == 999)
    );
    serve(&mut queue, Time::MAX, &mut served);
    assert!(served.contains(&(ms(840), Consumer::Stage(0, 1), 999)));
    assert!(is_empty(&queue));
}

#[test]
fn a_row_that_is_late_for_a_consumer_that_takes_late_rows_is_served_at_once() {
    let (mut queue, mut served) = (Queue::new(0), Served::new());
    queue.add_stream("emitted", 1);
    let port = Port {
        stream: 0,
        columns: vec![0],
        delay: 50_000_000,
    };
    let route = Route {
        consumer: Consumer::Aim(0),
        port,
        takes_late: true,
    };
    queue.connect(vec![route], Delays::default());
    queue.pass(ms(100));
    assert_eq!(feed(&mut queue, 0, (0, 120), &mut served), vec![]);
    assert_eq!(served, [(ms(100), Consumer::Aim(0), 0)]);
}

#[test]
fn rows_ahead_of_the_input_wait_until_the_input_is_silent() {
    let second = 1_000_000_000;
    let mut queue = queue();
    // Without any row of the input, other rows do not wait: the lag is 170 ms.
    let due = |queue: &mut Queue, stream, stamp| {
        let row = Row::new(stream, ms(stamp), &[0.0]);
        queue.note(row.time);
        queue.due(&row, second)
    };
    assert_eq!(due(&mut queue, 1, 100), (ms(-70), None));
    assert_eq!(due(&mut queue, 0, 200), (ms(30), None));
    for stamp in [2000, 2500, 3000] {
        assert_eq!(due(&mut queue, 1, stamp), (ms(30), None), "{stamp}");
    }
    // These rows span more than a sample of the input covers.
    assert_eq!(due(&mut queue, 2, 3001), (ms(2831), None));
    // The input is back, and the first of those rows was ahead by more than a sample covers.
    let (until, was_ahead) = due(&mut queue, 0, 300);
    let (stream, by) = was_ahead.unwrap();
    // 1 ns: the resolution of time.
    assert!((until, stream) == (ms(130), 1) && (by - 1.7).abs() < 1e-9, "{until} {stream} {by}");
}

#[test]
fn a_row_is_behind_once_anything_after_it_was_served_or_looked_at() {
    let (mut queue, mut served) = (queue(), Served::new());
    feed(&mut queue, 0, (0, 1000), &mut served);
    serve(&mut queue, ms(995), &mut served);
    // The stage was served at 990 ms. At that time the input is served before it, the sensors after it.
    assert_eq!(served, [(ms(990), Consumer::Stage(0, 0), 0)]);
    let behind = |queue: &Queue, stream, stamp| queue.has_passed(&Row::new(stream, ms(stamp), &[]), Time::MIN);
    assert!(!behind(&queue, 0, 1000) && behind(&queue, 0, 990));
    assert!(!behind(&queue, 2, 970) && behind(&queue, 2, 969));
    queue.see(ms(1001));
    assert!(behind(&queue, 2, 981) && !behind(&queue, 2, 982));
    // A consumer that the row reaches too late does not count.
    let row = Row::new(1, ms(1000), &[]);
    assert_eq!(queue.first_validity(&row, Time::MIN), Some(ms(930)));
    assert_eq!(queue.first_validity(&row, ms(931)), Some(ms(970)));
    assert_eq!(queue.first_validity(&row, ms(1001)), None);
}

#[test]
fn rows_are_held_back_for_the_buffer_the_longest_delay_and_the_lead_of_followers() {
    let mut queue = Queue::new(100);
    let delays = Delays {
        longest: 50,
        input: 20,
        lead: 0,
        are_apart: false,
        are_estimated: false,
    };
    let rule = |queue: &mut Queue, delays| {
        queue.connect(Vec::new(), delays);
        let certain = queue.certain(Time::default()).nanos();
        (queue.lag(), certain, queue.foresight())
    };
    // The input is present up to the instant before the longest delay after its own.
    assert_eq!(rule(&mut queue, delays), (150, 29, 0));
    assert_eq!(rule(&mut queue, Delays { lead: 7, ..delays }), (157, 36, 64));
    let estimated = Delays {
        are_estimated: true,
        ..delays
    };
    assert_eq!(rule(&mut queue, estimated), (150, 29, 50));
    // All rows of one stamp must be present, even without a buffer.
    let apart = Delays { are_apart: true, ..delays };
    assert_eq!(rule(&mut Queue::new(0), apart), (51, 29, 0));
    queue.hold_longer(1e-6);
    assert_eq!(queue.lag(), 1150);
    queue.use_at_once();
    assert_eq!(queue.lag(), 1120);
}
