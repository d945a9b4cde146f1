// SPDX-License-Identifier: MPL-2.0

//! What processes that share the cameras tell each other of who is seen where, by a connection of its own: no event waits behind it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rumqttc::{AsyncClient, EventLoop, Incoming, MqttOptions, Publish, QoS, SubscribeReasonCode};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::presence::Presence;
use super::topics::Topics;
use super::{PAUSE, next, options};
use crate::config::Mqtt;
use crate::handover::{Exchange, Message};
use crate::log::Log;

/// Somebody takes a quarter of a kilobyte; no picture shows a thousand.
const LONGEST: usize = 256 * 1024;
/// As many as come at once: a picture of each of many cameras. Later ones tell more.
const WAITING: usize = 64;

/// The connection, for as long as it lasts.
pub struct Exchanging([JoinHandle<()>; 2]);

impl Exchanging {
    /// Connects. Where that fails, or the broker lets nobody hear the tracks, that is said once.
    ///
    /// # Errors
    /// Where the certificates that are to be believed cannot be read.
    pub fn start(
        settings: &Mqtt,
        exchange: Arc<Exchange>,
        saying: mpsc::Receiver<Message>,
        log: Arc<Log>,
    ) -> Result<Self, session::Error> {
        let topics = Topics::new(settings, None, false);
        let mut options: MqttOptions = options(settings, "-tracks")?;
        options.set_max_packet_size(LONGEST, LONGEST);
        let (client, events) = AsyncClient::new(options, WAITING);
        let connected = Arc::new(AtomicBool::default());
        let hearing = Hearing {
            client: client.clone(),
            connected: connected.clone(),
            topics: topics.clone(),
            exchange,
            log,
        };
        Ok(Self([tokio::spawn(hearing.run(events)), tokio::spawn(say(client, connected, topics, saying))]))
    }

    /// Says and hears nothing any more.
    pub fn end(&self) {
        self.0.iter().for_each(JoinHandle::abort);
    }
}

struct Hearing {
    client: AsyncClient,
    connected: Arc<AtomicBool>,
    topics: Topics,
    exchange: Arc<Exchange>,
    log: Arc<Log>,
}

impl Hearing {
    async fn run(self, mut events: EventLoop) {
        let (mut warned, mut refused, mut presence) = (false, false, Presence::default());
        loop {
            let happened = next(&mut events).await;
            let is_to_be_told = presence.is_to_be_told(happened.is_ok(), Instant::now());
            match happened {
                Ok(rumqttc::Event::Incoming(Incoming::ConnAck(_))) => {
                    // The queue is empty: nothing is said before this.
                    let _ = self.client.try_subscribe(self.topics.tracks("+"), QoS::AtMostOnce);
                    self.connected.store(true, Ordering::Relaxed);
                }
                Ok(rumqttc::Event::Incoming(Incoming::SubAck(answer))) => {
                    let is_refused = answer.return_codes.contains(&SubscribeReasonCode::Failure);
                    if is_refused && !std::mem::replace(&mut refused, true) {
                        self.not_exchanged("it refuses the subscription");
                    }
                }
                Ok(rumqttc::Event::Incoming(Incoming::Publish(publish))) => {
                    if let Err(detail) = self.hear(&publish)
                        && !std::mem::replace(&mut warned, true)
                    {
                        self.log.error("tracks-not-understood", detail);
                    }
                }
                Ok(_) => {}
                Err(err) => {
                    self.connected.store(false, Ordering::Relaxed);
                    if is_to_be_told {
                        self.not_exchanged(&err.to_string());
                    }
                    tokio::time::sleep(PAUSE).await;
                }
            }
        }
    }

    fn not_exchanged(&self, reason: &str) {
        let topic = self.topics.tracks("+");
        let detail = format!(
            "the MQTT broker does not relay {topic}: {reason}. Nobody is handed over to or from cameras of other processes; \
             allow this user to connect twice, and to read and write there"
        );
        self.log.error("tracks-not-exchanged", detail);
    }

    fn hear(&self, Publish { topic, payload, .. }: &Publish) -> Result<(), String> {
        let Some(camera) = self.topics.camera_of_tracks(topic) else { return Ok(()) };
        self.exchange.hear(camera, payload).map_err(|reason| {
            format!(
                "a message at {topic} cannot be used: {reason}; nobody is handed over from or to {camera}. \
                 Run the same version everywhere, and have nothing else publish there."
            )
        })
    }
}

/// What is old by the time that the broker is there is not said.
async fn say(
    client: AsyncClient,
    connected: Arc<AtomicBool>,
    topics: Topics,
    mut saying: mpsc::Receiver<Message>,
) {
    while let Some((camera, said)) = saying.recv().await {
        if connected.load(Ordering::Relaxed) {
            let _ = client.try_publish(topics.tracks(&camera), QoS::AtMostOnce, false, said);
        }
    }
}
