//! Texts of the protocol.

use serde::Deserialize;
use serde_json::{Value, json};

/// The subprotocols that a client may ask for: that of the specification, and its new name in the SDK of Foxglove.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];

/// A request of a client.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum Request {
    Subscribe {
        subscriptions: Vec<Wanted>,
    },
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    /// A request that needs a capability that the server does not have.
    #[serde(other)]
    Other,
}

/// A subscription that a client wants.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Wanted {
    pub(super) id: u32,
    pub(super) channel_id: usize,
}

/// A channel as it is advertised. Its number is its place in the list of channels.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) schema_name: &'static str,
    /// A JSON schema.
    pub(super) schema: String,
}

/// The first message to a client. A client that connects again recognises a run by its session.
pub(super) fn server_info(description: &str, session: u128) -> String {
    let (name, session) = (format!("fusion: {description}"), session.to_string());
    json!({ "op": "serverInfo", "name": name, "capabilities": [], "sessionId": session }).to_string()
}

/// The second message: all channels.
pub(super) fn advertise(channels: &[Channel]) -> String {
    let channel = |(id, channel): (usize, &Channel)| {
        json!({
            "id": id,
            "topic": channel.topic,
            "encoding": "json",
            "schemaName": channel.schema_name,
            "schemaEncoding": "jsonschema",
            "schema": channel.schema,
        })
    };
    let channels: Vec<Value> = channels.iter().enumerate().map(channel).collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// A request that is ignored.
pub(super) fn warning(message: &str) -> String {
    json!({ "op": "status", "level": 1, "message": message }).to_string()
}
