//! Stamps: clocks, wrong stamps, gaps.

use super::{TV, read};

#[test]
fn a_clock_is_shifted_and_stretched_about_its_first_stamp_or_another() {
    let stamps = |time: &str| -> Vec<i64> {
        let toml = format!("time = {{ column = 't', {time} }}");
        let (rows, _) = read(&toml, b"t\n100\n200\n").unwrap();
        rows.into_iter().map(|(t, _)| t / 1_000_000).collect()
    };
    assert_eq!(stamps("offset = '-0.125 s'"), [99_875, 199_875]);
    assert_eq!(stamps("scale = 1.001"), [100_000, 200_100]);
    assert_eq!(stamps("scale = 1.001, about = 0"), [100_100, 200_200]);
    assert_eq!(
        stamps("unit = 'min', epoch = '99.5', scale = 2, about = '30 s', offset = 1"),
        [31_000, 12_031_000]
    );
    assert_eq!(stamps("start = '2 min'"), [200_000]);
    assert_eq!(stamps("stop = '200 s'"), [100_000]);
}

#[test]
fn a_stamp_in_two_columns_is_their_sum_to_the_nanosecond() {
    let stamps = |time: &str, data: &str| read(&format!("time = {{ {time} }}"), data.as_bytes());
    let of = |time: &str, data: &str| -> Vec<i64> { stamps(time, data).unwrap().0.into_iter().map(|(t, _)| t).collect() };
    let whole = "column = 'sec', plus = { column = 'nsec', each = '1 ns' }, epoch = '1752003258'";
    assert_eq!(
        of(whole, "sec,nsec\n1752003258,999999999\n1752003259,1\n"),
        [999_999_999, 1_000_000_001]
    );
    // The clock of every recording begins at zero.
    let recordings = "column = 't', plus = { column = 'n', each = '10 s' }";
    assert_eq!(of(recordings, "t,n\n0,0\n1.95,0\n0,1\n"), [0, 1_950_000_000, 10_000_000_000]);
    let wrong = stamps(recordings, "t,n\n0,x\n").unwrap_err().to_string();
    assert!(wrong.contains("`x` in column `n` is not a number"), "{wrong}");
    let missing = stamps("column = 't', plus = { column = 'week', each = '7 day' }", "t,n\n0,0\n")
        .unwrap_err()
        .to_string();
    assert!(missing.contains("no column `week`"), "{missing}");
}

/// A file of 10 Hz in which the stamp of one row is an hour ahead.
fn spoilt(rows: usize, wrong: usize) -> String {
    let stamp = |k: usize| 0.1 * k as f64 + if k == wrong { 3600.0 } else { 0.0 };
    let lines = (0..rows).map(|k| format!("{:.1},{k}\n", stamp(k)));
    format!("t,v\n{}", lines.collect::<String>())
}

#[test]
fn a_stamp_an_hour_ahead_costs_its_row_and_no_other() {
    for wrong in [0, 1, 2, 20, 38, 39] {
        let (rows, report) = read(TV, spoilt(40, wrong).as_bytes()).unwrap();
        let left: Vec<usize> = (0..40).filter(|k| *k != wrong).collect();
        assert_eq!(rows.iter().map(|(_, r)| r[0] as usize).collect::<Vec<_>>(), left);
        let skipped = &report.skipped[0];
        assert_eq!(
            (skipped.reason.as_str(), skipped.count, skipped.examples[0].number),
            ("time jumps ahead", 1, wrong + 2)
        );
    }
    let (_, report) = read(TV, spoilt(40, 20).as_bytes()).unwrap();
    let told = "3602.000000 s is 3600.100 s after the row before, and the next row goes back to 2.100000 s";
    assert_eq!(report.skipped[0].examples[0].what, told);
}

#[test]
fn up_to_twenty_stamps_an_hour_ahead_cost_their_rows_and_no_other() {
    for (from, length) in [(0, 2), (300, 2), (300, 20)] {
        let stamp = |k: usize| 0.1 * k as f64 + if (from..from + length).contains(&k) { 3600.0 } else { 0.0 };
        let line = |k: usize| match k {
            // The reader passes over a bad line.
            301 => "bad,1,2,3\n".to_owned(),
            k => format!("{:.1},{k}\n", stamp(k)),
        };
        let text = format!("t,v\n{}", (0..1000).map(line).collect::<String>());
        let (rows, report) = read(&format!("bad_rows = 'skip'\n{TV}"), text.as_bytes()).unwrap();
        let left = (0..1000).filter(|k| *k != 301 && !(from..from + length).contains(k));
        assert_eq!(
            rows.iter().map(|(_, r)| r[0] as usize).collect::<Vec<_>>(),
            left.collect::<Vec<_>>()
        );
        let jumps = report.skipped.iter().find(|s| s.reason == "time jumps ahead").unwrap();
        assert_eq!(jumps.count as usize, length - usize::from(from == 300), "{from} {length}");
    }
    // A longer run of them is a gap, and no row after a gap may go back.
    let text: String = (0..100).map(|k| format!("{},{k}\n", if k < 50 { k } else { 3600 + k })).collect();
    assert_eq!(read(TV, format!("t,v\n{text}").as_bytes()).unwrap().0.len(), 100);
}

#[test]
fn an_hour_without_rows_is_a_gap_and_the_end_of_the_source_is_where_it_is_declared() {
    let text = "t,v\n0,0\n1,1\n2,2\n3602,3\n3603,4\n3604,5\n";
    assert_eq!(read(TV, text.as_bytes()).unwrap().0.len(), 6);
    // A wrong stamp does not end the source.
    let toml = TV.replace("'t' }", "'t', stop = '1 min' }");
    assert_eq!(read(&toml, spoilt(40, 20).as_bytes()).unwrap().0.len(), 39);
    assert_eq!(read(&toml, text.as_bytes()).unwrap().0.len(), 3);
    // No row after it can be read, so it is not confirmed.
    let toml = format!("bad_rows = 'skip'\n{TV}");
    let (rows, report) = read(&toml, b"t,v\n0,0\n1,1\n2,2\n3602,3\nx,4\n3,5\n4,6\n").unwrap();
    assert_eq!((rows.len(), report.left_out()), (5, 2), "{report}");
}

#[test]
fn the_increment_after_a_wrong_stamp_covers_the_nominal_interval() {
    let toml = "rate = '10 Hz'\ntime = { column = 't', scale = 2 }
        channels.w = { columns = ['d'], unit = 'rad', increment = true }";
    let (rows, _) = read(toml, b"t,d\n0,1\n0.05,1\n3600,1\n0.15,1\n0.2,1\n").unwrap();
    let rates: Vec<f64> = rows.iter().map(|(_, row)| (row[0] * 1e9).round() / 1e9).collect();
    assert_eq!(rates, [10.0; 4]);
    // The clock is correct at the first valid stamp: not at 3600 s.
    let (rows, _) = read(toml, b"t,d\n3600,1\n5,1\n5.05,1\n").unwrap();
    assert_eq!(rows.iter().map(|(t, _)| t / 1_000_000).collect::<Vec<_>>(), [5000, 5100]);
}

/// The stamps of a file decoded with `time`, in nanoseconds.
fn stamped(time: &str, data: &str) -> Result<Vec<i64>, String> {
    let (rows, _) = read(&format!("time = {{ {time} }}"), data.as_bytes())?;
    Ok(rows.into_iter().map(|(t, _)| t).collect())
}

#[test]
fn logs_of_unix_gps_and_calendar_time_share_one_scale() {
    // One instant and another 1.5 s later, as five loggers write it: 18 leap seconds in 2025, GPS week 2374.
    let logs = [
        (
            "column = 't', calendar = 'utc', epoch = '2025-07-08T19:34:00Z'",
            "t\n2025-07-08T19:34:18.25Z\n2025-07-08T21:34:19.75+02:00\n",
        ),
        (
            "date = 'd', column = 't', calendar = 'gps', epoch = '2025-07-08T19:34:00Z'",
            "d,t\n2025/07/08,19:34:36.25\n2025/07/08,19:34:37.75\n",
        ),
        (
            "column = 't', unit = 'ms', counts_from = 'unix', epoch = '2025-07-08T19:34:00Z'",
            "t\n1752003258250\n1752003259750\n",
        ),
        (
            "column = 's', plus = { column = 'ns', each = '1 ns' }, counts_from = 'unix', epoch = 1752003240",
            "s,ns\n1752003258,250000000\n1752003259,750000000\n",
        ),
        (
            "column = 'sow', plus = { column = 'week', each = '7 day' }, counts_from = 'gps', epoch = '2025-07-08T19:34:18'",
            "week,sow\n2374,243276.25\n2374,243277.75\n",
        ),
    ];
    for (time, data) in logs {
        assert_eq!(stamped(time, data).unwrap(), [18_250_000_000, 19_750_000_000], "{time}");
    }
    // A leap second passes in UTC, and in Unix time, which leaves it out.
    let leap = "t\n2016-12-31T23:59:59Z\n2016-12-31T23:59:60Z\n2017-01-01T00:00:00Z\n";
    let calendar = "column = 't', calendar = 'utc', epoch = '2016-12-31T23:59:59Z'";
    assert_eq!(stamped(calendar, leap).unwrap(), [0, 1_000_000_000, 2_000_000_000]);
    let unix = "column = 't', counts_from = 'unix', epoch = '2016-12-31T23:59:59Z'";
    assert_eq!(stamped(unix, "t\n1483228799\n1483228800\n").unwrap(), [0, 2_000_000_000]);
}

#[test]
fn what_is_wrong_with_a_date_is_said_by_line_and_column() {
    let utc = "column = 't', calendar = 'utc', epoch = '2025-07-08T19:34:00Z'";
    for (cell, what) in [
        (
            "08.07.2025 19:34:18",
            "is not a date and time, year first, such as `2025-07-08T19:34:18.25Z`",
        ),
        ("2025-02-30 19:34:18", "does not exist: there is no such day or time of day"),
        ("2025-07-08 19:34:18 GPST", "names another time scale than is declared"),
    ] {
        let wrong = stamped(utc, &format!("t\n{cell}\n")).unwrap_err();
        let expected = format!("error: `{cell}` in column `t` {what}\n--> log.csv:2");
        assert!(wrong.starts_with(&expected), "{wrong}");
    }
    let declared = |time: &str| stamped(time, "t\n1\n").unwrap_err();
    for (time, what) in [
        (
            "column = 't', calendar = 'utc', epoch = '8 July'",
            "`8 July` is not a date and time, year first",
        ),
        ("column = 't', epoch = '2025-07-08T19:34:00Z'", "say what the stamps count from"),
        ("column = 't', calendar = 'utc', unit = 's'", "`unit` does not apply to a calendar"),
        ("column = 't', date = 't'", "a date needs its `calendar`"),
    ] {
        assert!(declared(time).contains(what), "{}", declared(time));
    }
    let zero = stamped("column = 't', calendar = 'gps', epoch = 5", "t\n2025-07-08 00:00:00\n").unwrap_err();
    assert!(zero.contains("`5` is not a date and time"), "{zero}");
}

#[test]
fn dates_in_other_orders_and_times_of_day_are_read_as_declared() {
    let epoch = "epoch = '2025-07-08T19:34:18Z'";
    for (time, data) in [
        (
            "column = 't', calendar = 'utc', order = 'dmy'",
            "t\n08/07/2025 19:34:18.5\n08/07/2025 19:34:19\n",
        ),
        (
            "column = 't', calendar = 'utc', order = 'mdy'",
            "t\n7/8/25 19:34:18.5\n7/8/25 19:34:19\n",
        ),
        (
            "date = 'd', column = 't', calendar = 'utc', order = 'dmy'",
            "d,t\n080725,193418.50\n080725,193419.00\n",
        ),
        ("column = 't', calendar = 'utc', day = '2025-07-08'", "t\n19:34:18.5\n193419\n"),
    ] {
        assert_eq!(
            stamped(&format!("{time}, {epoch}"), data).unwrap(),
            [500_000_000, 1_000_000_000],
            "{time}"
        );
    }
    for (time, cell, what) in [
        (
            "column = 't', calendar = 'utc'",
            "08/07/2025 10:00:00",
            "begins with the day or the month",
        ),
        (
            "column = 't', calendar = 'utc'",
            "10:00:00.5",
            "has no date: name its column by `date`, or write",
        ),
        ("column = 't', calendar = 'utc', day = '2025-07-08'", "10:61:00", "does not exist"),
        (
            "column = 't', calendar = 'utc', day = '2025-07-08'",
            "noon",
            "is no time of day, such as",
        ),
    ] {
        let wrong = stamped(time, &format!("t\n{cell}\n")).unwrap_err();
        assert!(wrong.starts_with(&format!("error: `{cell}` in column `t` {what}")), "{wrong}");
    }
    for (time, what) in [
        ("column = 't', order = 'dmy'", "an order of a date needs its `calendar`"),
        ("column = 't', day = '2025-07-08'", "a date needs its `calendar`"),
        (
            "column = 't', calendar = 'utc', day = '8.7.2025'",
            "`8.7.2025` is no date such as `2025-07-08`",
        ),
        ("column = 't', calendar = 'utc', day = '2025-02-30'", "is no date such as"),
        (
            "column = 't', date = 'd', calendar = 'utc', day = '2025-07-08'",
            "`date` does not apply to times of day",
        ),
    ] {
        let wrong = stamped(time, "t,d\n1,1\n").unwrap_err();
        assert!(wrong.contains(what), "{wrong}");
    }
}

#[test]
fn times_of_day_go_on_after_midnight_and_do_not_jump_a_day_for_one_that_goes_back() {
    let toml = "calendar = 'utc', day = '2025-07-08', epoch = '2025-07-08T23:59:58Z'";
    let first = "column = 't', ";
    let of = |data: &str| stamped(&format!("{first}{toml}"), data);
    let seconds = |found: Vec<i64>| -> Vec<i64> { found.into_iter().map(|t| t / 1_000_000_000).collect() };
    // The first row is the last of its day, too.
    assert_eq!(seconds(of("t\n23:59:59\n00:00:00\n00:00:01\n").unwrap()), [1, 2, 3]);
    assert_eq!(
        seconds(of("t\n23:59:58\n08:00:00\n19:00:00\n03:00:00\n").unwrap()),
        [0, 28_802, 68_402, 97_202]
    );
    let back = of("t\n23:59:59\n00:00:00\n00:00:01\n23:59:59\n").unwrap_err();
    assert!(
        back.starts_with("error: time runs backwards: 1.000000 s comes after 3.000000 s"),
        "{back}"
    );
    let skipping = "backwards = 'skip', ";
    let left = stamped(&format!("{first}{skipping}{toml}"), "t\n23:59:59\n00:00:00\n23:59:58\n00:00:01\n").unwrap();
    assert_eq!(seconds(left), [1, 2, 3]);
    // A stamp that jumps ahead is wrong if the next stamp goes back: it does not change the day.
    let jump = of("t\n23:59:58\n23:59:59\n00:00:00\n05:00:00\n00:00:01\n00:00:02\n").unwrap();
    assert_eq!(seconds(jump), [0, 1, 2, 3, 4]);
}

#[test]
fn rows_without_stamps_and_counters_of_samples_have_a_rate() {
    assert_eq!(stamped("rate = '100 Hz'", "v\n1\n2\n3\n").unwrap(), [0, 10_000_000, 20_000_000]);
    // A row that cannot be read still counts as recorded.
    let bad = "bad_rows = 'skip'\ntime = { rate = '100 Hz' }\nchannels.v = { column = 'v', unit = 'm/s' }";
    let (rows, _) = read(bad, b"v\n1\nx\n1,2\n3\n").unwrap();
    assert_eq!(rows.iter().map(|(t, _)| *t).collect::<Vec<_>>(), [0, 30_000_000]);
    let counter = "column = 'Packet number', rate = '256 Hz'";
    let text = "Packet number\n512\n513\n1024\n1025\n";
    assert_eq!(
        stamped(counter, text).unwrap(),
        [2_000_000_000, 2_003_906_250, 4_000_000_000, 4_003_906_250]
    );
    assert_eq!(stamped(&format!("{counter}, epoch = 512"), text).unwrap()[0], 0);
    // No interval in whole nanoseconds: the stamps do not drift by its rounding. 3e7 / 30 Hz is 1e6 s.
    assert_eq!(
        stamped("column = 'n', rate = '30 Hz'", "n\n30000000\n").unwrap(),
        [1_000_000_000_000_000]
    );
    for (time, what) in [
        (
            "start = 0",
            "a row has its stamp in a `column`, or rows are evenly spaced and have a `rate`",
        ),
        ("column = 'n', rate = '1 Hz', unit = 's'", "`unit` does not apply to a rate"),
        (
            "column = 'n', rate = '1 Hz', calendar = 'utc'",
            "`calendar` does not apply to a rate",
        ),
        (
            "column = 'n', rate = '1 Hz', epoch = 'noon'",
            "the epoch of a counter is the count at time zero",
        ),
    ] {
        let wrong = stamped(time, "n\n1\n").unwrap_err();
        assert!(wrong.contains(what), "{wrong}");
    }
    let wrong = stamped("column = 'n', rate = '1 Hz'", "n\nx\n").unwrap_err();
    assert!(
        wrong.starts_with("error: `x` in column `n` is not a number\n--> log.csv:2"),
        "{wrong}"
    );
}

#[test]
fn rows_of_several_instruments_with_equal_stamps_are_told_apart_by_valid_alone() {
    let toml = "time = { column = 't' }\nvalid = { column = 'I', equals = 0 }\nchannels.v = { column = 'v', unit = 'm/s' }";
    let text = "t,I,v\n0,1,10\n0,0,1\n0.1,0,2\n0.1,1,20\n0.05,1,30\n900,1,40\n0.2,0,3\nlost,1,50\n0.3,0,4\n";
    let (rows, report) = read(toml, text.as_bytes()).unwrap();
    let seen: Vec<_> = rows.iter().map(|(t, row)| (t / 1_000_000, row[0])).collect();
    assert_eq!(seen, [(0, 1.0), (100, 2.0), (200, 3.0), (300, 4.0)]);
    assert_eq!(
        (report.skipped.len(), report.skipped[0].reason.as_str(), report.skipped[0].count),
        (1, "not valid as declared", 5)
    );
    // Two rows of one instrument are still no pair.
    let tie = read(toml, b"t,I,v\n0,0,1\n0,1,2\n0,0,3\n").unwrap_err();
    assert!(
        tie.starts_with("error: the stamp 0.000000 s is equal to that of the row before\n--> log.csv:4"),
        "{tie}"
    );
}

#[test]
fn an_increment_covers_the_interval_of_its_instrument() {
    let rates = |more: &str, text: &str| -> Vec<f64> {
        let toml = format!(
            "{more}time = {{ column = 't' }}\nvalid = {{ column = 'I', equals = 0 }}
            channels.w = {{ columns = ['d'], unit = 'rad', increment = true }}"
        );
        let (rows, _) = read(&toml, text.as_bytes()).unwrap();
        rows.iter().map(|(_, row)| (row[0] * 1e9).round() / 1e9).collect()
    };
    // Equal stamps, in either order; a row that is left out has its own interval.
    let pairs = "t,I,d\n0,0,1\n0,1,9\n0.1,1,9\n0.1,0,1\n0.2,1,9\n0.3,0,1\n0.4,0,1\n";
    assert_eq!(rates("", pairs), [10.0; 3]);
    // Stamps of the other instrument come a little earlier: with the nominal rate they do not matter.
    let between = "t,I,d\n0,0,1\n0.09,1,9\n0.1,0,1\n0.19,1,9\n0.2,0,1\n";
    assert_eq!(rates("rate = '10 Hz'\n", between), [10.0; 3]);
    // A wrong stamp of the other instrument has no effect on later stamps.
    let wrong = "t,I,d\n0,0,1\n0.1,0,1\n900,1,9\n0.2,0,1\n0.3,0,1\n";
    assert_eq!(rates("", wrong), [10.0; 3]);
}
