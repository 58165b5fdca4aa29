//! A run while it goes on, for viewers: Foxglove and Lichtblick connect over a WebSocket and get what a log gets.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use foxglove::{
    ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use serde::Serialize;

use super::contents::{LoggedEvent, LoggedSample, event_schema, event_units, schema, units};
use super::{EVENT_SCHEMA, EVENTS, SAMPLE_SCHEMA, TOPIC};

/// Messages that wait for a viewer; one that is slower misses some, the run waits for none.
const BACKLOG: usize = 16_384;

/// Viewers cannot be served.
#[derive(Debug, thiserror::Error)]
#[error("{address}: viewers cannot be served there: {source}; give another address, as --live 127.0.0.1:8766")]
pub struct StreamError {
    address: SocketAddr,
    source: FoxgloveError,
}

/// Serves viewers until it is dropped.
pub struct RunStream {
    server: Option<WebSocketServerHandle>,
    /// Channels live as long as it.
    _context: Arc<Context>,
    url: String,
    samples: Arc<RawChannel>,
    events: Arc<RawChannel>,
    /// When the device's clock stood at zero \[ns since 1970\], once there was a sample.
    began: Option<u64>,
}

impl RunStream {
    /// Serves at `address` a run whose output has this unit.
    ///
    /// # Errors
    /// When the address cannot be had.
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

    /// Where viewers connect to.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Shows a sample.
    pub fn sample(&mut self, sample: &LoggedSample) {
        self.began.get_or_insert_with(|| {
            let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
            now.saturating_sub((sample.time_s * 1e9) as u64)
        });
        self.show(&self.samples, sample.time_s, sample);
    }

    /// Shows what has happened.
    pub fn event(&self, event: &LoggedEvent) {
        self.show(&self.events, event.time_s, event);
    }

    fn show(&self, channel: &RawChannel, time_s: f64, message: &impl Serialize) {
        // Nobody looks: nothing is to be done.
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
