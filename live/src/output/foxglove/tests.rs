//! Clients of a server over loopback.

use super::queue::{MOST_WAITING, Next, Queue};
use super::server::{MOST_CLIENTS, Patience, Server};
use super::*;
use crate::output::testing::{NOW, about, estimate};
use crate::output::{Outgoing, SensorNow};
use fusion::core::health::State;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Error, Message as Received, WebSocket};

/// More than a loaded machine needs for an answer.
const SOON: Duration = Duration::from_secs(20);
/// 2025-07-08 19:34:18.25 UTC in nanoseconds since 1970-01-01.
const UNIX: u64 = 1_752_003_258_250_000_000;

fn opened() -> Foxglove {
    let mut about = about();
    about.sensors = vec!["gnss".to_owned(), "wheel".to_owned()];
    Foxglove::open((Ipv4Addr::LOCALHOST, 0).into(), &about).unwrap()
}

/// An estimate with the k-th measurement of the first sensor.
fn measured(k: u64) -> Outgoing {
    let sensor = SensorNow {
        time: Some(Time::from_seconds(9.5)),
        used: k,
        rejected: 2,
        is_used: true,
        nis: Some(1.25),
        residual: vec![0.5, -1.0],
        sigma: vec![1.0, 1.0],
    };
    Outgoing {
        number: k,
        sensors: Arc::from([sensor, SensorNow::default()]),
        ..estimate()
    }
}

struct Client(WebSocket<TcpStream>);

impl Client {
    fn open(address: SocketAddr, protocols: Option<&'static str>) -> Result<Self, Box<Error>> {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(SOON)).unwrap();
        let mut request = format!("ws://{address}").into_client_request().unwrap();
        if let Some(protocols) = protocols {
            let header = HeaderValue::from_static(protocols);
            request.headers_mut().insert("Sec-WebSocket-Protocol", header);
        }
        match tungstenite::client(request, stream) {
            Ok((socket, response)) => {
                let chosen = response.headers()["Sec-WebSocket-Protocol"].to_str().unwrap();
                assert!(protocols.unwrap().contains(chosen));
                Ok(Self(socket))
            }
            Err(tungstenite::HandshakeError::Failure(error)) => Err(Box::new(error)),
            Err(interrupted) => panic!("{interrupted}"),
        }
    }

    /// Connects, and returns the two texts that a client receives first.
    fn greeted(address: SocketAddr, protocols: &'static str) -> (Self, Value, Value) {
        let mut client = Self::open(address, Some(protocols)).unwrap();
        let (info, channels) = (client.text(), client.text());
        (client, info, channels)
    }

    fn new(address: SocketAddr) -> Self {
        Self::greeted(address, "foxglove.websocket.v1").0
    }

    fn say(&mut self, request: &Value) {
        self.0.send(Received::text(request.to_string())).unwrap();
    }

    /// Subscribes to a channel by a number, and waits until the server has read this.
    fn subscribe(&mut self, pairs: &[(u32, usize)]) {
        let subscriptions: Vec<Value> = pairs
            .iter()
            .map(|(id, channel)| json!({ "id": id, "channelId": channel }))
            .collect();
        self.say(&json!({ "op": "subscribe", "subscriptions": subscriptions }));
        self.0.send(Received::Ping(Vec::new().into())).unwrap();
        while !matches!(self.0.read().unwrap(), Received::Pong(_)) {}
    }

    fn text(&mut self) -> Value {
        loop {
            match self.0.read().unwrap() {
                Received::Text(text) => return serde_json::from_str(&text).unwrap(),
                Received::Ping(_) => {}
                other => panic!("{other}"),
            }
        }
    }

    /// The next message: the subscription, the time and the content.
    fn message(&mut self) -> (u32, u64, Value) {
        loop {
            match self.0.read().unwrap() {
                Received::Binary(bytes) => {
                    assert_eq!(bytes[0], 1);
                    let id = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
                    let time = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
                    return (id, time, serde_json::from_slice(&bytes[13..]).unwrap());
                }
                Received::Ping(_) => {}
                other => panic!("{other}"),
            }
        }
    }

    /// The code and the reason with which it is closed.
    fn closed(&mut self) -> (CloseCode, String) {
        loop {
            if let Received::Close(Some(frame)) = self.0.read().unwrap() {
                return (frame.code, frame.reason.to_string());
            }
        }
    }
}

/// Waits until something holds.
fn until(mut holds: impl FnMut() -> bool) {
    let end = Instant::now() + SOON;
    while !holds() {
        assert!(Instant::now() < end, "it does not hold");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The threads of this process with the port of a server in their names; `None` where the system does not list them.
fn threads(server: &Server) -> Option<usize> {
    let name = format!("foxglove {}", server.address.port());
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let names = tasks.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("comm")).ok());
    Some(names.filter(|own| own.trim() == name).count())
}

#[test]
fn a_client_receives_the_channels_that_it_wants_and_their_numbers() {
    let mut output = opened();
    let (mut client, info, channels) = Client::greeted(output.server.address, "other.v1, foxglove.sdk.v1");
    assert_eq!(info["op"], "serverInfo");
    assert_eq!(info["name"], "fusion: a test");
    assert_eq!(channels["op"], "advertise");
    let channel = |key: &str| -> Vec<String> {
        let all = channels["channels"].as_array().unwrap();
        all.iter().map(|channel| channel[key].as_str().unwrap().to_owned()).collect()
    };
    let topics = channel("topic");
    assert_eq!(
        topics,
        [
            "/fix",
            "/pose",
            "/tf",
            "/estimate",
            "/health",
            "/innovations/gnss",
            "/innovations/wheel"
        ]
    );
    assert_eq!(channel("schemaName")[..2], ["foxglove.LocationFix", "foxglove.PoseInFrame"]);
    client.subscribe(&[
        (10, FIX),
        (11, POSE),
        (12, TRANSFORM),
        (13, ESTIMATE),
        (14, HEALTH),
        (15, SENSORS),
        (16, SENSORS + 1),
    ]);
    for k in 0..20 {
        output.send(&measured(1 + k / 2), None).unwrap();
    }
    let mut count: BTreeMap<u32, u32> = BTreeMap::new();
    let mut first: BTreeMap<u32, (u64, Value)> = BTreeMap::new();
    // Four of each estimate, one health, and the innovations of ten measurements.
    for _ in 0..4 * 20 + 1 + 10 {
        let (id, time, message) = client.message();
        *count.entry(id).or_default() += 1;
        first.entry(id).or_insert((time, message));
    }
    assert_eq!(count, BTreeMap::from([(10, 20), (11, 20), (12, 20), (13, 20), (14, 1), (15, 10)]));
    assert!(first.values().all(|(time, _)| *time == UNIX), "{first:?}");

    let stamp = json!({ "sec": 1_752_003_258_u32, "nsec": 250_000_000 });
    let is_near = |value: &Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-9;
    let fix = &first[&10].1;
    assert_eq!((&fix["timestamp"], &fix["frame_id"]), (&stamp, &json!("base_link")));
    assert!(is_near(&fix["latitude"], 47.0 + 17.11437 / 60.0) && is_near(&fix["longitude"], -8.0 - 33.91522 / 60.0));
    assert!(is_near(&fix["altitude"], 545.4) && is_near(&fix["heading"], 123.456_f64.to_radians()));
    // East, north, up of 3 m towards 30°, 1 m across and 2 m down: 3 and 7 m², and (9 − 1) sin 30° cos 30°.
    let across = 8.0 * 0.75_f64.sqrt() / 2.0;
    for (k, expected) in [3.0, across, 0.0, across, 7.0, 0.0, 0.0, 0.0, 4.0].into_iter().enumerate() {
        assert!(is_near(&fix["position_covariance"][k], expected), "{fix}");
    }
    assert_eq!(fix["velocity"], json!({ "x": -4.0, "y": 3.0, "z": -0.5 }));
    assert_eq!(first[&13].1["velocity"], json!([3.0, -4.0, 0.5]));
    assert_eq!(first[&14].1["message"], "good");
    assert_eq!(first[&14].1["level"], 2);
    let innovation = json!({
        "time": 9.5, "is_used": true, "nis": 1.25, "residual": [0.5, -1.0], "sigma": [1.0, 1.0], "used": 1, "rejected": 2
    });
    assert_eq!(first[&15].1, innovation);
    // Forward of a vehicle with the heading 123.456° and 2° nose up, in east, north, up.
    let rotation = &first[&12].1["rotation"];
    let [x, y, z, w] = ["x", "y", "z", "w"].map(|axis| rotation[axis].as_f64().unwrap());
    let forward = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z)) * Vector3::x();
    let (heading, pitch) = (123.456_f64.to_radians(), 2_f64.to_radians());
    let expected = Vector3::new(heading.sin() * pitch.cos(), heading.cos() * pitch.cos(), pitch.sin());
    // 10 ε of rotations.
    assert!((forward - expected).norm() < 1e-14, "{forward}");
    assert_eq!(first[&11].1["pose"]["orientation"], *rotation);
    assert_eq!(first[&11].1["pose"]["position"], json!({ "x": 0.0, "y": 0.0, "z": 0.0 }));
}

#[test]
fn before_the_start_only_what_is_known_is_sent() {
    let mut output = opened();
    let mut client = Client::new(output.server.address);
    client.subscribe(&[(0, FIX), (1, POSE), (3, ESTIMATE), (4, HEALTH)]);
    let mut waiting = Outgoing {
        solution: None,
        health: State::Aligning,
        waits_for: Arc::from(["gnss".to_owned(), "imu".to_owned()]),
        ..estimate()
    };
    output.send(&waiting, None).unwrap();
    let (id, _, message) = client.message();
    assert_eq!((id, &message["waits_for"]), (3, &json!(["gnss", "imu"])));
    assert!(message.get("latitude").is_none());
    assert_eq!(client.message().2["message"], "aligning: waits for gnss, imu");
    (waiting.health, waiting.waits_for) = (State::Lost, Arc::default());
    waiting.reasons = Arc::from(["`gnss` silent".to_owned(), "no input".to_owned()]);
    output.send(&waiting, None).unwrap();
    assert_eq!(client.message().0, 3);
    let (_, _, log) = client.message();
    assert_eq!(
        (&log["message"], &log["level"]),
        (&json!("lost: `gnss` silent; no input"), &json!(4))
    );
    // A place that is not finite is on no map.
    let mut nowhere = estimate();
    nowhere
        .solution
        .iter_mut()
        .for_each(|s| s.position.iter_mut().for_each(|(place, _)| place.lat = f64::NAN));
    nowhere.health = waiting.health;
    nowhere.reasons = waiting.reasons.clone();
    output.send(&nowhere, None).unwrap();
    let (id, _, message) = client.message();
    assert_eq!((id, &message["latitude"]), (3, &Value::Null));
    // A new subscriber has the health at once.
    let mut other = Client::new(output.server.address);
    other.say(&json!({ "op": "subscribe", "subscriptions": [{ "id": 7, "channelId": HEALTH }] }));
    assert_eq!(other.message().2, log);
}

/// The types that Foxglove reads of a JSON schema.
fn check_schema(schema: &Value, at: &str) {
    assert!(schema.get("$ref").is_none() && schema.get("anyOf").is_none(), "{at}: {schema}");
    match schema["type"].as_str() {
        Some("object") => {
            for (name, inner) in schema["properties"].as_object().unwrap() {
                check_schema(inner, &format!("{at}.{name}"));
            }
        }
        Some("array") => check_schema(&schema["items"], &format!("{at}[]")),
        Some("boolean" | "integer" | "number" | "string") => {}
        other => panic!("{at} is {other:?}"),
    }
}

#[test]
fn the_schemas_are_those_that_foxglove_reads() {
    for channel in messages::channels(&["gnss".to_owned()]) {
        let schema: Value = serde_json::from_str(&channel.schema).unwrap();
        check_schema(&schema, &channel.topic);
        assert!(schema["properties"].as_object().unwrap().len() >= 3, "{schema}");
    }
}

#[test]
fn a_client_that_breaks_the_protocol_is_closed_with_a_reason() {
    let mut output = opened();
    let long = format!("{{\"op\": \"{}\"}}", "x".repeat(1 << 18));
    for (message, code, text) in [
        (Received::binary(vec![1, 0, 0, 0, 0]), CloseCode::Unsupported, "no binary messages"),
        (
            Received::text("hello"),
            CloseCode::Protocol,
            "not a request of foxglove.websocket.v1",
        ),
        (Received::text("{\"channelId\": 1}"), CloseCode::Protocol, "missing field `op`"),
        (
            Received::text("{\"op\": \"subscribe\", \"subscriptions\": [{\"id\": -1, \"channelId\": 0}]}"),
            CloseCode::Protocol,
            "invalid value: integer `-1`",
        ),
        (Received::text(long), CloseCode::Size, "too long"),
    ] {
        let mut client = Client::new(output.server.address);
        client.0.send(message).unwrap();
        let (closed, reason) = client.closed();
        assert_eq!(closed, code, "{reason}");
        assert!(reason.contains(text) && reason.len() <= 123, "{reason}");
    }
    // A frame without a mask.
    let mut client = Client::new(output.server.address);
    client.0.get_mut().write_all(&[0x81, 2, b'{', b'}']).unwrap();
    assert_eq!(client.closed().0, CloseCode::Protocol);
    // The others, and the output, are not disturbed.
    until(|| output.server.count().clients == 0);
    let mut client = Client::new(output.server.address);
    client.subscribe(&[(0, FIX)]);
    output.send(&estimate(), None).unwrap();
    assert_eq!(client.message().0, 0);
    assert_eq!(output.status().unwrap(), format!("1 client at ws://{}", output.server.address));
}

#[test]
fn a_request_that_cannot_be_served_is_ignored_with_a_warning() {
    let mut output = opened();
    let mut client = Client::new(output.server.address);
    let subscribe = |id: u32, channel: usize| json!({ "op": "subscribe", "subscriptions": [{ "id": id, "channelId": channel }] });
    for (request, text) in [
        (subscribe(1, 99), "there is no channel 99"),
        (json!({ "op": "unsubscribe", "subscriptionIds": [5] }), "there is no subscription 5"),
        (
            json!({ "op": "getParameters", "parameterNames": [] }),
            "`subscribe` and `unsubscribe` only",
        ),
    ] {
        client.say(&request);
        let warning = client.text();
        assert_eq!((&warning["op"], &warning["level"]), (&json!("status"), &json!(1)));
        assert!(warning["message"].as_str().unwrap().contains(text), "{warning}");
    }
    client.subscribe(&[(1, ESTIMATE)]);
    for (request, text) in [
        (subscribe(1, FIX), "the subscription 1 exists"),
        (subscribe(2, ESTIMATE), "the channel 3 has a subscription"),
    ] {
        client.say(&request);
        assert!(client.text()["message"].as_str().unwrap().contains(text));
    }
    client.say(&json!({ "op": "unsubscribe", "subscriptionIds": [1] }));
    client.subscribe(&[(1, FIX)]);
    output.send(&estimate(), None).unwrap();
    assert!(client.message().2.get("latitude").is_some());
}

#[test]
fn other_programs_are_refused() {
    let output = opened();
    for protocols in [None, Some("chat, superchat")] {
        let Err(error) = Client::open(output.server.address, protocols) else {
            panic!("it is connected")
        };
        let Error::Http(response) = *error else { panic!("{error}") };
        assert_eq!(response.status(), 400);
    }
    let mut stream = TcpStream::connect(output.server.address).unwrap();
    stream.set_read_timeout(Some(SOON)).unwrap();
    stream.write_all(b"$GPGGA,no request\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    assert_eq!(answer, b"");
    until(|| threads(&output.server).is_none_or(|count| count == 1));
    let taken = Foxglove::open(output.server.address, &about()).err().unwrap();
    assert_eq!(taken.kind(), ErrorKind::AddrInUse);
    assert!(
        taken.to_string().contains(&format!("cannot listen on {}", output.server.address)),
        "{taken}"
    );
}

#[test]
fn a_slow_client_loses_the_oldest_messages_and_delays_no_other() {
    let mut output = opened();
    let mut slow = Client::new(output.server.address);
    slow.subscribe(&[(0, ESTIMATE), (1, FIX)]);
    let mut quick = Client::new(output.server.address);
    quick.subscribe(&[(0, ESTIMATE)]);
    // An estimate of 40 kB, so that the buffers of the sockets are full soon.
    let mut large = Outgoing {
        reasons: Arc::from([String::from_utf8(vec![b'x'; 40_000]).unwrap()]),
        ..estimate()
    };
    let count = 2000_u64;
    let read = Arc::new(AtomicU64::new(0));
    let counter = read.clone();
    let reader = std::thread::spawn(move || {
        for k in 0..count {
            assert_eq!(quick.message().1, UNIX - 10_000_000_000 + k * 1_000_000_000);
            counter.store(k + 1, Ordering::Relaxed);
        }
        quick
    });
    let mut longest = Duration::ZERO;
    for k in 0..count {
        large.time = Time::from_nanos(k as i64 * 1_000_000_000);
        let begin = Instant::now();
        output.send(&large, None).unwrap();
        longest = longest.max(begin.elapsed());
        // The quick client has the time that it needs, at least three seconds in all. The slow client reads nothing.
        until(|| read.load(Ordering::Relaxed) + MOST_WAITING as u64 / 2 > k);
        std::thread::sleep(Duration::from_micros(1500));
    }
    let quick = reader.join().unwrap();
    // The server waits for a socket for 60 s: this is far less, and far more than a loaded machine needs.
    assert!(longest < Duration::from_secs(2), "{longest:?}");
    let dropped = output.server.count().dropped;
    assert!(dropped > 500, "{dropped}");
    assert_eq!(
        output.status().unwrap(),
        format!(
            "2 clients at ws://{}, {dropped} messages dropped for slow clients",
            output.server.address
        )
    );
    // The slow client has the oldest messages, which its socket has kept, and the newest. None is out of order.
    let mut times = [Vec::new(), Vec::new()];
    while times
        .iter()
        .any(|times: &Vec<u64>| times.last() != Some(&(UNIX - 10_000_000_000 + 1_000_000_000 * (count - 1))))
    {
        let (id, time, _) = slow.message();
        times[id as usize].push(time);
    }
    assert!(times.iter().all(|times| times.is_sorted()));
    assert_eq!(times.iter().map(Vec::len).sum::<usize>() as u64 + dropped, 2 * count);
    for times in times {
        let newest = &times[times.len() - MOST_WAITING..];
        assert!(newest.windows(2).all(|pair| pair[1] - pair[0] == 1_000_000_000), "{newest:?}");
    }
    drop(quick);
}

#[test]
fn no_thread_and_no_memory_is_left_of_a_client_that_went() {
    let mut output = opened();
    let mut clients: Vec<Client> = (0..4).map(|_| Client::new(output.server.address)).collect();
    clients.iter_mut().for_each(|client| client.subscribe(&[(0, ESTIMATE), (1, FIX)]));
    let shared = output.server.watched();
    assert_eq!(shared.len(), 4);
    until(|| threads(&output.server).is_none_or(|count| count == 9));
    // One says goodbye, one breaks the protocol, one is cut off, one is cut off while it does not read.
    clients[0].0.close(None).unwrap();
    clients[1].0.send(Received::text("?")).unwrap();
    clients[2].0.get_mut().shutdown(std::net::Shutdown::Both).unwrap();
    let large = Outgoing {
        reasons: Arc::from([String::from_utf8(vec![b'x'; 100_000]).unwrap()]),
        ..estimate()
    };
    for _ in 0..300 {
        output.send(&large, None).unwrap();
    }
    drop(clients);
    until(|| shared.iter().all(|client| client.upgrade().is_none()));
    assert_eq!(output.server.count().clients, 0);
    until(|| threads(&output.server).is_none_or(|count| count == 1));
    output.send(&estimate(), None).unwrap();
}

#[test]
fn a_server_that_ends_tells_its_clients() {
    let mut output = opened();
    let mut client = Client::new(output.server.address);
    client.subscribe(&[(0, ESTIMATE)]);
    // This client never reads again: its socket is full.
    let mut stuck = Client::new(output.server.address);
    stuck.subscribe(&[(0, ESTIMATE)]);
    let large = Outgoing {
        reasons: Arc::from([String::from_utf8(vec![b'x'; 100_000]).unwrap()]),
        ..estimate()
    };
    for _ in 0..300 {
        output.send(&large, None).unwrap();
    }
    let reader = std::thread::spawn(move || client.closed());
    let (address, clients) = (output.server.address, output.server.watched());
    let begin = Instant::now();
    drop(output);
    // Half a second for clients that do not answer; the rest is for a loaded machine.
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    assert_eq!(reader.join().unwrap(), (CloseCode::Away, "the filter has ended".to_owned()));
    assert!(clients.iter().all(|client| client.upgrade().is_none()));
    assert!(TcpStream::connect(address).is_err());
}

#[test]
fn a_client_that_does_not_answer_a_ping_is_closed() {
    let patience = Patience {
        ping: Duration::from_millis(50),
        silence: Duration::from_millis(1500),
    };
    let server = Server::start((Ipv4Addr::LOCALHOST, 0).into(), Default::default(), 1, patience);
    let server = server.unwrap();
    let [mut answers, mut silent] = [0, 1].map(|_| Client::open(server.address, Some("foxglove.websocket.v1")).unwrap());
    // A client answers while it reads, and is there after twice the time.
    let until = Instant::now() + 2 * patience.silence;
    while Instant::now() < until {
        assert!(!matches!(answers.0.read().unwrap(), Received::Close(_)));
    }
    // Without an answer to the pings: the last frame has the code of a policy, then the reason.
    let mut bytes = Vec::new();
    silent.0.get_mut().read_to_end(&mut bytes).unwrap();
    let reason = [
        &1008_u16.to_be_bytes()[..],
        b"nothing was received for 1.5s, no answer to a ping either",
    ]
    .concat();
    assert!(bytes.ends_with(&reason), "{}", String::from_utf8_lossy(&bytes));
    assert_eq!(server.count().clients, 1);
}

#[test]
fn the_number_of_clients_has_a_limit() {
    let output = opened();
    let mut clients: Vec<Client> = (0..MOST_CLIENTS).map(|_| Client::new(output.server.address)).collect();
    let Err(error) = Client::open(output.server.address, Some("foxglove.websocket.v1")) else {
        panic!("it is connected")
    };
    let Error::Http(response) = *error else { panic!("{error}") };
    assert_eq!(response.status(), 503);
    clients.truncate(1);
    until(|| output.server.count().clients == 1);
    assert!(Client::new(output.server.address).0.can_read());
}

#[test]
fn a_queue_drops_the_oldest_message_of_the_channel_that_is_full() {
    let queue = Queue::default();
    queue.subscribe(7, 3).unwrap();
    queue.subscribe(8, 4).unwrap();
    let message = |time: u64| Arc::new(Message { time, payload: Vec::new() });
    assert!(!queue.push(5, &message(0)), "without a subscription");
    assert!(!queue.push(4, &message(1000)));
    let limit = MOST_WAITING as u64;
    let dropped = (0..limit + 3).filter(|time| queue.push(3, &message(*time))).count();
    assert_eq!(dropped, 3);
    let next = || match queue.next(Duration::ZERO) {
        // Two bytes of the frame, the opcode, then the subscription and the time.
        Next::Bytes(bytes) => Some((bytes[3], u64::from_le_bytes(bytes[7..15].try_into().unwrap()))),
        Next::Nothing | Next::End => None,
    };
    assert_eq!(next(), Some((8, 1000)));
    assert_eq!(next(), Some((7, 3)));
    assert!(!queue.push(3, &message(limit + 3)));
    // An end of a subscription takes its messages.
    queue.push(4, &message(1001));
    queue.unsubscribe(7).unwrap();
    assert_eq!(next(), Some((8, 1001)));
    assert_eq!(next(), None);
    assert!(matches!(queue.next(Duration::ZERO), Next::Nothing));
    // Answers come first, and have a limit.
    queue.push(4, &message(1002));
    queue.answer(b"pong").unwrap();
    assert!(matches!(queue.next(Duration::ZERO), Next::Bytes(bytes) if bytes == b"pong"));
    let refused = (0..1000).find_map(|_| queue.answer(&[0; 1 << 10]).err()).unwrap();
    assert_eq!(refused.kind(), ErrorKind::QuotaExceeded);
    queue.end(None);
    queue.push(4, &message(1003));
    assert!(matches!(queue.next(Duration::ZERO), Next::Bytes(bytes) if bytes.len() == (1 << 18) + (1 << 10)));
    assert!(matches!(queue.next(Duration::ZERO), Next::End));
}

#[test]
fn the_clock_of_the_messages_is_that_of_the_estimates() {
    assert_eq!(about().clock.unix_nanos(estimate().time) as u64, UNIX);
    assert_eq!(estimate().gps_nanos, Some(NOW));
    let spec: Box<dyn OutputSpec> = serde_json::from_str(r#"{"foxglove": {}}"#).unwrap();
    assert_eq!(spec.link(), None);
    assert_eq!(standard_port().to_string(), "127.0.0.1:8765");
}
