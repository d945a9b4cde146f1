// SPDX-License-Identifier: MPL-2.0

//! What happens, told to an MQTT broker: events as they come, and what is kept there for who comes later.

mod presence;
mod topics;
mod tracks;

use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use presence::Presence;
use rumqttc::{
    AsyncClient, ConnectionError, EventLoop, Incoming, LastWill, MqttOptions, Outgoing, QoS,
    TlsConfiguration, Transport,
};
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinHandle;
use topics::{OFFLINE, ONLINE, Topics};
pub use tracks::Exchanging;

use crate::config::Mqtt;
use crate::event::Event;
use crate::fleet::Fleet;
use crate::log::Log;
use crate::shard::Shard;

/// Between two tries to reach the broker.
const PAUSE: Duration = Duration::from_secs(5);
/// Between two looks at what is kept by the broker.
const EVERY: Duration = Duration::from_secs(1);
/// Between two times that we say that we are there: a broker may tell of the end of a connection that was lost before this one only
/// now, and that we are gone.
const REPEATED: Duration = Duration::from_secs(60);
/// A connection on which nothing was said for so long is tried.
const KEEP_ALIVE: Duration = Duration::from_secs(20);
/// So many messages wait for a broker that is away.
const WAITING: usize = 256;
/// A broker has little to say, and no picture is longer than that, in bytes.
const LONGEST_HEARD: usize = 10 * 1024;
const LONGEST_SAID: usize = 1024 * 1024;
/// For the last words.
const LONGEST_END: Duration = Duration::from_secs(1);

/// A connection to a broker, until [`Publisher::end`].
pub struct Publisher {
    client: AsyncClient,
    availability: String,
    connection: JoinHandle<()>,
    publishing: JoinHandle<()>,
}

impl Publisher {
    /// Connects, and tells from now on what happens; pictures where they are kept.
    ///
    /// # Errors
    /// Where the certificates that are to be believed cannot be read.
    pub fn start(
        settings: &Mqtt,
        shard: Option<Shard>,
        pictures: bool,
        fleet: Arc<Fleet>,
        log: Arc<Log>,
    ) -> Result<Self, session::Error> {
        let topics = Topics::new(settings, shard, pictures);
        let mut options = options(settings, "")?;
        options.set_max_packet_size(LONGEST_HEARD, LONGEST_SAID);
        options.set_last_will(LastWill::new(topics.availability(), OFFLINE, QoS::AtLeastOnce, true));
        let (client, events) = AsyncClient::new(options, WAITING);
        let connected = Arc::new(AtomicBool::default());
        let broker = format!("{}:{}", settings.host, settings.port);
        Ok(Self {
            availability: topics.availability(),
            connection: tokio::spawn(keep_connected(events, connected.clone(), broker, log.clone())),
            publishing: tokio::spawn(publish(client.clone(), connected, topics, fleet, log)),
            client,
        })
    }

    /// Says that we are gone.
    pub async fn end(self) {
        self.publishing.abort();
        // Or it may yet say that we are there.
        let _ = self.publishing.await;
        // For a broker that is away our last will does that.
        let _ = self.client.try_publish(self.availability, QoS::AtLeastOnce, true, OFFLINE);
        let _ = self.client.try_disconnect();
        let _ = tokio::time::timeout(LONGEST_END, self.connection).await;
    }
}

/// Where the broker is, and who we are; `what` tells our connections apart. A broker ends a connection where another one begins by the
/// same name: two containers may have the host's name and the same number of a process.
fn options(settings: &Mqtt, what: &str) -> Result<MqttOptions, session::Error> {
    // Of keys that are drawn by chance.
    let chance = RandomState::new().build_hasher().finish();
    let id = format!("ptztrack-{}-{chance:016x}{what}", glib::host_name());
    let mut options = MqttOptions::new(id, &settings.host, settings.port);
    options.set_keep_alive(KEEP_ALIVE);
    if let Some(credentials) = &settings.credentials {
        options.set_credentials(&credentials.user, credentials.password.reveal());
    }
    if let Some(trust) = &settings.tls {
        let tls = TlsConfiguration::Rustls(Arc::new(trust.client_config(true)?));
        options.set_transport(Transport::tls_with_config(tls));
    }
    Ok(options)
}

/// What happens next on a connection. Where it breaks, all that was under way is lost: what the broker keeps is published again, and
/// events are told once at most. The library would keep it until a broker says that it has forgotten us, and one that never says
/// so and hangs up each time would have it grow without end.
///
/// # Errors
/// Why there is no connection, or no more.
async fn next(events: &mut EventLoop) -> Result<rumqttc::Event, ConnectionError> {
    let happened = events.poll().await;
    if happened.is_err() {
        events.pending.clear();
        // A message whose number was still taken, as the broker answered in another order. As long as it waits, none is sent.
        events.state.collision = None;
    }
    happened
}

/// Says that the broker is away, and that it is there.
async fn keep_connected(mut events: EventLoop, connected: Arc<AtomicBool>, broker: String, log: Arc<Log>) {
    let mut presence = Presence::default();
    loop {
        let happened = next(&mut events).await;
        let is_to_be_told = presence.is_to_be_told(happened.is_ok(), Instant::now());
        match happened {
            Ok(rumqttc::Event::Outgoing(Outgoing::Disconnect)) => return,
            Ok(event) => {
                if matches!(event, rumqttc::Event::Incoming(Incoming::ConnAck(_))) {
                    connected.store(true, Ordering::Relaxed);
                }
                if is_to_be_told {
                    log.info("mqtt-connected", format!("connected to the MQTT broker {broker}"));
                }
            }
            Err(err) => {
                if is_to_be_told {
                    let detail =
                        format!("no connection to the MQTT broker {broker}: {err}; it is tried again");
                    log.error("mqtt-disconnected", detail);
                }
                tokio::time::sleep(PAUSE).await;
            }
        }
    }
}

/// Events as they come, and what is kept as it changes.
async fn publish(
    client: AsyncClient,
    connected: Arc<AtomicBool>,
    topics: Topics,
    fleet: Arc<Fleet>,
    log: Arc<Log>,
) {
    let mut events = log.subscribe();
    let mut timer = tokio::time::interval(EVERY);
    let mut kept = BTreeMap::new();
    let mut repeated = tokio::time::interval_at(tokio::time::Instant::now() + REPEATED, REPEATED);
    loop {
        tokio::select! {
            _ = repeated.tick() => {
                kept.remove(&topics.availability());
            }
            event = events.recv() => match event {
                Ok(event) => publish_event(&client, &topics, &event),
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            _ = timer.tick() => {
                if connected.swap(false, Ordering::Relaxed) {
                    // It may have forgotten, or be another one.
                    kept.clear();
                }
                let mut wanted = BTreeMap::from([(topics.availability(), ONLINE.to_owned())]);
                wanted.extend(fleet.known().iter().flat_map(|known| topics.kept(known)));
                for (topic, payload) in changes(&kept, &wanted) {
                    if client.try_publish(&topic, QoS::AtLeastOnce, true, payload.as_str()).is_ok() {
                        kept.insert(topic, payload);
                    }
                }
                kept.retain(|_, payload| !payload.is_empty());
            }
        }
    }
}

/// One that finds no place is lost: what is kept tells how things are.
fn publish_event(client: &AsyncClient, topics: &Topics, event: &Event) {
    if let Ok(payload) = serde_json::to_string(event) {
        let _ = client.try_publish(topics.event(event.camera.as_deref()), QoS::AtMostOnce, false, payload);
    }
    // The broker keeps none, so that who is deleted here is not there either.
    if let (Some(camera), Some(jpeg)) = (&event.camera, &event.jpeg)
        && jpeg.len() < LONGEST_SAID / 2
    {
        let _ = client.try_publish(topics.picture(camera), QoS::AtMostOnce, false, jpeg.to_vec());
    }
}

/// What is to be published, by topic; with an empty payload the broker forgets it.
fn changes(kept: &BTreeMap<String, String>, wanted: &BTreeMap<String, String>) -> Vec<(String, String)> {
    let new = wanted.iter().filter(|(topic, payload)| kept.get(*topic) != Some(payload));
    let gone = kept.keys().filter(|topic| !wanted.contains_key(*topic));
    new.map(|(topic, payload)| (topic.clone(), payload.clone()))
        .chain(gone.map(|topic| (topic.clone(), String::new())))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpListener;

    use rumqttc::Publish;

    use super::*;

    /// A broker that says each time that it knows us, hears this many bytes after that, and hangs up; its port.
    fn broker(hears: usize) -> u16 {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let mut stream = stream.unwrap();
                // CONNECT, which is short.
                let mut head = [0; 2];
                stream.read_exact(&mut head).unwrap();
                stream.read_exact(&mut vec![0; head[1].into()]).unwrap();
                // CONNACK: the session is present, and accepted.
                stream.write_all(&[0x20, 2, 1, 0]).unwrap();
                stream.read_exact(&mut vec![0; hears]).unwrap();
            }
        });
        port
    }

    #[tokio::test]
    async fn a_broker_that_hangs_up_each_time_and_claims_to_know_us_leaves_nothing_behind() {
        let options = MqttOptions::new("test", "127.0.0.1", broker(1));
        let (client, mut events) = AsyncClient::new(options, WAITING);
        for _ in 0..3 {
            for _ in 0..50 {
                client.try_publish("topic", QoS::AtLeastOnce, true, "payload").unwrap();
            }
            let mut published = 0;
            while let Ok(happened) = next(&mut events).await {
                if matches!(happened, rumqttc::Event::Outgoing(Outgoing::Publish(_))) {
                    published += 1;
                    events.state.collision = Some(Publish::new("topic", QoS::AtLeastOnce, "payload"));
                }
            }
            assert!(published > 0, "what collided in the last connection keeps nothing from this one");
            assert!(events.pending.is_empty() && events.state.collision.is_none());
        }
    }

    #[test]
    fn what_changed_is_published_and_what_is_gone_forgotten() {
        let map = |pairs: &[(&str, &str)]| {
            pairs.iter().map(|(topic, payload)| ((*topic).to_owned(), (*payload).to_owned())).collect()
        };
        let kept = map(&[("a", "1"), ("b", "1"), ("c", "1")]);
        let wanted = map(&[("a", "1"), ("b", "2"), ("d", "1")]);
        let pairs = changes(&kept, &wanted);
        let pairs: Vec<_> = pairs.iter().map(|(topic, payload)| (topic.as_str(), payload.as_str())).collect();
        assert_eq!(pairs, [("b", "2"), ("d", "1"), ("c", "")]);
    }
}
