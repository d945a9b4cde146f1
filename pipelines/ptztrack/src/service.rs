// SPDX-License-Identifier: MPL-2.0

//! What runs until it is told to end.

use std::future::pending;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use sd_notify::NotifyState;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::task::JoinHandle;
use tokio::time::{Interval, interval};

use crate::config::{Again, CameraSettings, Config, NotLoaded, Watchdogs};
use crate::event::{Event, Level};
use crate::fleet::Fleet;
use crate::handover::{Exchange, HandingOver};
use crate::log::Log;
use crate::services::{Saying, Services};
use crate::shard::Shard;
use crate::store::Keeper;

/// For cameras to end: the end of a stream is waited for 10 s, and stopping a camera that does not answer takes some more.
const LONGEST_END: Duration = Duration::from_secs(20);
/// Between two looks for a password, or another file that is needed, that could not be read.
const LOOK_AGAIN: Duration = Duration::from_secs(10);

/// Where the cameras come from, and come from again on SIGHUP.
pub enum Origin {
    /// With the page elsewhere than the file says, where that is said.
    File {
        path: PathBuf,
        shard: Option<Shard>,
        watchdogs: Watchdogs,
        page: Option<SocketAddr>,
    },
    CommandLine(Box<Config>),
}

impl Origin {
    /// Which share of the cameras is ours.
    fn shard(&self) -> Option<Shard> {
        match self {
            Self::File { shard, .. } => *shard,
            Self::CommandLine(_) => None,
        }
    }

    /// # Errors
    /// What is wrong with the file.
    pub fn read(&self) -> Result<Config, NotLoaded> {
        match self {
            Self::File { path, shard, watchdogs, page } => {
                let mut config = Config::load(path)?.with_page_at(*page).map_err(NotLoaded::Mistaken)?;
                config.cameras.iter_mut().for_each(|camera| camera.use_watchdog(watchdogs));
                config.cameras.retain(|camera| shard.is_none_or(|shard| shard.has(camera)));
                Ok(config)
            }
            Self::CommandLine(config) => Ok(config.as_ref().clone()),
        }
    }
}

/// Follows with all cameras until SIGTERM or SIGINT.
///
/// # Errors
/// Why it cannot start; or, of one camera from the command line, why it was given up.
pub async fn run(origin: Arc<Origin>, config: Config, log: Arc<Log>) -> Result<(), String> {
    let said = |err: std::io::Error| err.to_string();
    let mut ends = [SignalKind::terminate(), SignalKind::interrupt()].map(signal).into_iter();
    let (Some(terminate), Some(interrupt)) = (ends.next(), ends.next()) else { return Ok(()) };
    let (mut terminate, mut interrupt) = (terminate.map_err(said)?, interrupt.map_err(said)?);
    let mut hangup = signal(SignalKind::hangup()).map_err(said)?;

    let fleet = Arc::new(Fleet::of_share(origin.shard(), log.clone()));
    tell_waiting(&config, None, &log);
    let (exchange, saying) = exchange(&origin, &config, &log).unzip();
    let mut services =
        Services::new(origin.shard(), exchange.clone().zip(saying), fleet.clone(), log.clone());
    services.start(&config);
    let keeper = Keeper::start(&config.store, &log);
    fleet.apply(config.cameras.clone());
    let tell = |err: &std::io::Error| log.error("not-handing-over", format!("nobody is handed over: {err}"));
    let handing_over =
        HandingOver::start(&config, fleet.clone(), exchange, log.clone()).inspect_err(tell).ok();
    notify(&[NotifyState::Ready]);
    let mut alive = alive();
    let mut second = interval(Duration::from_secs(1));
    let mut looking = interval(LOOK_AGAIN);
    let mut keeping = None;
    let mut current = config;
    // Elsewhere: a disk may hang, and whoever waits for us to be alive waits.
    let mut reading: Option<JoinHandle<Option<Config>>> = None;
    let read = |current: &Config, only_changes| {
        let (origin, current, fleet, log) = (origin.clone(), current.clone(), fleet.clone(), log.clone());
        Some(tokio::task::spawn_blocking(move || read_again(&origin, &current, only_changes, &fleet, &log)))
    };
    loop {
        tokio::select! {
            () = end(&mut terminate, &mut interrupt) => break,
            config = finished(&mut reading) => if let Some(config) = config {
                handing_over.iter().for_each(|handing_over| handing_over.change(&config));
                services.change(&config);
                current = config;
            },
            _ = hangup.recv(), if reading.is_none() => reading = read(&current, false),
            _ = looking.tick(), if reading.is_none() => {
                if current.cameras.iter().any(|camera| camera.no_password.is_some()) || !current.waiting().is_empty() {
                    reading = read(&current, true);
                }
            }
            () = tick(&mut alive) => if fleet.stuck().is_empty() {
                notify(&[NotifyState::Watchdog]);
            },
            _ = second.tick() => {
                fleet.start_all();
                keep_control(&fleet, &mut keeping);
                if log.has_terminal() {
                    log.show_status(fleet.known().iter().map(|known| format!("{}: {}", known.name, known.in_words())).collect());
                }
                if matches!(*origin, Origin::CommandLine(_)) && fleet.is_over() {
                    return Err("Nothing is left to follow with.".to_owned());
                }
            }
        }
    }
    notify(&[NotifyState::Stopping]);
    log.show_status(Vec::new());
    log.info("ending", "ends: every camera is brought to rest");
    // No camera waits for those who watch.
    let passing_on = services.restreaming.take();
    let passing_on = passing_on.map(|restreaming| tokio::task::spawn_blocking(|| restreaming.end()));
    let ending = fleet.clone();
    let ended = tokio::task::spawn_blocking(move || {
        ending.end();
        handing_over.into_iter().for_each(HandingOver::end);
    });
    if tokio::time::timeout(LONGEST_END, ended).await.is_err() {
        log.error(
            "not-ended",
            "a camera's pipeline or a disk hangs: a camera that still moves is stopped by its watchdog",
        );
    }
    if let Some(passing_on) = passing_on {
        let _ = passing_on.await;
    }
    if let Some(keeper) = keeper {
        let _ = tokio::task::spawn_blocking(|| keeper.end()).await;
    }
    services.end().await;
    Ok(())
}

/// With the other processes that share the cameras, where there are any.
fn exchange(origin: &Origin, config: &Config, log: &Log) -> Option<(Arc<Exchange>, Saying)> {
    origin.shard()?;
    if config.mqtt == Ok(None) {
        if config.hands_over_to_others() {
            let detail = "people are handed over to and from other processes only with [mqtt] in the file";
            log.tell(&Event::new(Level::Warning, None, "not-handing-over", detail.to_owned()));
        }
        return None;
    }
    Some(Exchange::new())
}

/// Says of the services that cannot be started yet why they cannot, unless that was said before.
fn tell_waiting(config: &Config, before: Option<&Config>, log: &Log) {
    let said = before.map(Config::waiting).unwrap_or_default();
    for (table, reason) in config.waiting().into_iter().filter(|waiting| !said.contains(waiting)) {
        let detail = format!(
            "[{table}] is not started: {reason}; put that right: it is looked at again every {} s, and then started",
            LOOK_AGAIN.as_secs()
        );
        log.tell(&Event::new(Level::Warning, None, "service-waits", detail));
    }
}

/// Where a disk hangs, it waits for itself and for nobody else.
fn keep_control(fleet: &Arc<Fleet>, keeping: &mut Option<JoinHandle<()>>) {
    if keeping.as_ref().is_none_or(JoinHandle::is_finished) {
        let fleet = fleet.clone();
        *keeping = Some(tokio::task::spawn_blocking(move || fleet.keep_control()));
    }
}

/// What was read, where something was; never where nothing is being read.
async fn finished(reading: &mut Option<JoinHandle<Option<Config>>>) -> Option<Config> {
    let Some(task) = reading else { return pending().await };
    // A panic in there has been said.
    let config = task.await.ok().flatten();
    *reading = None;
    config
}

/// Has what the file says now count; a file with mistakes changes nothing. What GStreamer lacked may be there now.
fn read_again(
    origin: &Origin,
    current: &Config,
    only_changes: bool,
    fleet: &Fleet,
    log: &Log,
) -> Option<Config> {
    // Its reason to fail would be that no plugin can be read, and the cameras say what they lack.
    let _ = gst::Registry::update();
    let counts = |read| if only_changes { waited_for(read, current) } else { read };
    match origin.read().map(|config| Again::of(counts(config), current)) {
        Ok(again) if only_changes && again.config == *current => None,
        Ok(Again { config, needs_restart, lost }) => {
            log.info("read-again", "the configuration was read again");
            if needs_restart {
                log.error(
                    "restart-needed",
                    "changes in [http], [mqtt], [events], [zone] and [restream] need a restart to take effect",
                );
            }
            for (table, reason) in lost {
                let detail = format!("[{table}] goes on with what it has: {reason}");
                log.tell(&Event::new(Level::Warning, None, "service-not-read", detail));
            }
            tell_waiting(&config, Some(current), log);
            if !only_changes || config.cameras != current.cameras {
                fleet.apply(config.cameras.clone());
            }
            Some(config)
        }
        Err(_) if only_changes => None,
        Err(failure) => {
            log.error("not-read", format!("everything stays as it was: {}", failure.reason()));
            None
        }
    }
}

/// Of what was read, cameras and services that waited for it: whoever saved something else has yet to ask for it.
fn waited_for(read: Config, current: &Config) -> Config {
    let now = |camera: &CameraSettings| {
        let has_waited = camera.no_password.is_some();
        let found = read.cameras.iter().find(|read| has_waited && read.name == camera.name);
        found.unwrap_or(camera).clone()
    };
    let cameras = current.cameras.iter().map(now).collect();
    let waiting = current.waiting();
    let waits = |table| waiting.iter().any(|(waiting, _)| *waiting == table);
    Config {
        cameras,
        http: if waits("http") { read.http } else { current.http.clone() },
        mqtt: if waits("mqtt") { read.mqtt } else { current.mqtt.clone() },
        restream: if waits("restream") { read.restream } else { current.restream.clone() },
        ..current.clone()
    }
}

async fn end(terminate: &mut Signal, interrupt: &mut Signal) {
    tokio::select! {
        _ = terminate.recv() => {}
        _ = interrupt.recv() => {}
    }
}

/// How often systemd wants to hear of us, if it does: twice in the time that it waits.
fn alive() -> Option<Interval> {
    sd_notify::watchdog_enabled().map(|time| interval(time / 2))
}

async fn tick(interval: &mut Option<Interval>) {
    match interval {
        Some(interval) => drop(interval.tick().await),
        None => pending().await,
    }
}

/// Without systemd there is nobody to tell.
fn notify(state: &[NotifyState]) {
    let _ = sd_notify::notify(state);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with these addresses of two cameras, the second of which waits for its password, as the broker does.
    fn config(first: &str, second: &str, password: &str) -> Config {
        let text = format!(
            "[mqtt]\nhost = \"{first}\"\nuser = \"u\"\npassword-file = \"{password}\"\n\
             [camera.a]\naddress = \"http://{first}\"\n\
             [camera.b]\naddress = \"http://{second}\"\nuser = \"u\"\npassword-file = \"{password}\"\n"
        );
        Config::parse(&text).unwrap()
    }

    #[test]
    fn what_did_not_wait_changes_only_where_it_is_asked_for() {
        gst::init().unwrap();
        let current = config("a", "b", "/nowhere/password");
        assert_eq!(current.waiting().len(), 1);
        // The password is there, and meanwhile somebody edits the rest.
        let password = std::env::temp_dir().join(format!("ptztrack-waited-{}", std::process::id()));
        std::fs::write(&password, "xyzzy").unwrap();
        let read = config("c", "d", password.to_str().unwrap());
        std::fs::remove_file(password).unwrap();
        let counts = waited_for(read.clone(), &current);
        assert_eq!(counts.cameras, [current.cameras[0].clone(), read.cameras[1].clone()]);
        assert_eq!(counts.mqtt, read.mqtt);
        assert_eq!(waited_for(current.clone(), &read).cameras, read.cameras, "nobody waits");
    }
}
