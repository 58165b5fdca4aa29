//! Streams a run to viewers (Foxglove, Lichtblick) over a WebSocket, with the messages of the log.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use foxglove::{
    ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use serde::Serialize;

use super::contents::{LoggedEvent, LoggedSample, event_schema, event_units, schema, units};
use super::{EVENT_SCHEMA, EVENTS, SAMPLE_SCHEMA, TOPIC};

/// Maximum number of messages that wait for a viewer.
/// A slower viewer misses messages; the run never waits.
const BACKLOG: usize = 16_384;

/// Error of a stream whose address cannot be opened.
#[derive(Debug, thiserror::Error)]
#[error("{address}: cannot listen for viewers: {source}; give another address, for example --live 127.0.0.1:8766")]
pub struct StreamError {
    address: SocketAddr,
    source: FoxgloveError,
}

/// Streams a run to viewers until it is dropped.
pub struct RunStream {
    server: Option<WebSocketServerHandle>,
    /// Keeps the channels alive.
    _context: Arc<Context>,
    url: String,
    samples: Arc<RawChannel>,
    events: Arc<RawChannel>,
    /// Zero of the device's clock \[ns since 1970\]; `None` before the first sample.
    began: Option<u64>,
}

impl RunStream {
    /// Listens at `address` for viewers of a run; `unit` is the unit of its output.
    ///
    /// # Errors
    /// When the address cannot be opened.
    pub fn at(address: SocketAddr, unit: &str) -> Result<Self, StreamError> {
        let failed = |source| StreamError { address, source };
        let context = Context::new();
        let channel = |topic, name, schema: serde_json::Value, units| {
            ChannelBuilder::new(topic)
                .message_encoding("json")
                .schema(Schema::new(name, "jsonschema", schema.to_string().into_bytes()))
                .metadata(units)
                .context(&context)
                .build_raw()
        };
        let samples = channel(TOPIC, SAMPLE_SCHEMA, schema(unit), units(unit)).map_err(failed)?;
        let events = channel(EVENTS, EVENT_SCHEMA, event_schema(), event_units()).map_err(failed)?;
        let server = WebSocketServer::new()
            .name(concat!("hystctl ", env!("CARGO_PKG_VERSION")))
            .bind(address.ip().to_string(), address.port())
            .message_backlog_size(BACKLOG)
            .context(&context)
            .start_blocking()
            .map_err(failed)?;
        let url = format!("ws://{}", SocketAddr::new(address.ip(), server.port()));
        Ok(Self { server: Some(server), _context: context, url, samples, events, began: None })
    }

    /// Returns the URL that viewers connect to.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Sends a sample.
    pub fn sample(&mut self, sample: &LoggedSample) {
        self.began.get_or_insert_with(|| {
            let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
            now.saturating_sub((sample.time_s * 1e9) as u64)
        });
        self.send(&self.samples, sample.time_s, sample);
    }

    /// Sends an event.
    pub fn event(&self, event: &LoggedEvent) {
        self.send(&self.events, event.time_s, event);
    }

    fn send(&self, channel: &RawChannel, time_s: f64, message: &impl Serialize) {
        // No viewer is connected.
        if !channel.has_sinks() {
            return;
        }
        if let Ok(text) = serde_json::to_vec(message) {
            let log_time = Some(self.began.unwrap_or(0) + (time_s * 1e9) as u64);
            channel.log_with_meta(&text, PartialMetadata { log_time });
        }
    }
}

impl Drop for RunStream {
    fn drop(&mut self) {
        if let Some(server) = self.server.take() {
            server.stop().wait_blocking();
        }
    }
}
