// SPDX-License-Identifier: MPL-2.0

//! The process of one camera: does what a thread does for it, is told what to do, and tells what is known.

use std::io;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream as StdUnixStream;
use std::sync::Arc;
use std::time::Duration;

use rustix::process::{Resource, Rlimit, setrlimit};
use serde::de::DeserializeOwned;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::broadcast;
use tokio::time::interval;

use super::line;
use super::protocol::{Order, Report, Start, Word};
use crate::camera::{self, Camera, Look, Packet, Shown};
use crate::log::Log;
use crate::waiting::Sightings;

/// Between two reports.
const EVERY: Duration = Duration::from_millis(500);

/// A camera of 4K takes a quarter of that. Who asks for more ends here, and not the machine.
const MOST_MEMORY: u64 = 2 * 1024 * 1024 * 1024;

/// Runs the camera that the socket on standard input names, until that closes.
///
/// # Errors
/// Where nothing on standard input says which camera.
pub async fn run() -> io::Result<()> {
    let most = Rlimit { current: Some(MOST_MEMORY), maximum: Some(MOST_MEMORY) };
    setrlimit(Resource::Data, most)?;
    let socket = StdUnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    socket.set_nonblocking(true)?;
    let (orders, words) = UnixStream::from_std(socket)?.into_split();
    let mut orders = BufReader::new(orders).lines();
    let start: Start = next(&mut orders).await?.ok_or(io::ErrorKind::UnexpectedEof)?;
    let log = Arc::new(Log::unwritten());
    let mut events = log.subscribe();
    let sightings = log.sightings();
    let hands_over = start.settings.hands_over;
    let mut camera = Camera::here(start.settings, start.control, start.worked, log);
    let known = camera.known.clone();
    camera.start()?;
    let mut process = Child { words, heard: 0 };
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut timer = interval(EVERY);
    let mut look: Option<Look> = None;
    let mut packets: Option<broadcast::Receiver<Packet>> = None;
    let mut sights = known.sight.subscribe();
    while !camera.is_over() {
        tokio::select! {
            order = next(&mut orders) => {
                let Ok(Some(order)) = order else { break };
                process.heard += 1;
                match order {
                    Order::Select { x, y } => known.select(x, y),
                    Order::SelectTrack(id) => known.select_track(id),
                    Order::Ignore(ids) => known.ignore(ids),
                    Order::Release => known.release(),
                    Order::Steer(hand) => known.steer(hand.into()),
                    Order::Turn(turn) => {
                        known.turn(turn);
                    }
                    Order::Look(somebody) => look = somebody.then(|| known.look()),
                    Order::Stream(taken) => packets = taken.then(|| known.packets.subscribe()),
                }
            }
            Ok(event) = events.recv() => process.say(&Word::Event(event)).await?,
            picture = next_picture(&mut look) => {
                let Shown { jpeg, target } = picture;
                process.say(&Word::Picture(jpeg, target)).await?;
            }
            packet = next_packet(&mut packets) => process.say(&Word::Packet(Box::new(packet))).await?,
            Ok(()) = sights.changed(), if hands_over => {
                let (at, sight) = (**sights.borrow_and_update()).clone();
                process.say(&Word::Sight(at.elapsed(), sight)).await?;
            }
            _ = timer.tick() => {
                process.say_all(&sightings).await?;
                process.report(&camera).await?;
            }
            _ = terminate.recv() => break,
            _ = interrupt.recv() => break,
        }
    }
    drop(look);
    camera.end();
    while !camera.is_over() {
        process.report(&camera).await?;
        timer.tick().await;
    }
    process.say_all(&sightings).await?;
    while let Ok(event) = events.try_recv() {
        process.say(&Word::Event(event)).await?;
    }
    process.report(&camera).await
}

async fn next<T: DeserializeOwned>(lines: &mut Lines<BufReader<OwnedReadHalf>>) -> io::Result<Option<T>> {
    let Some(line) = lines.next_line().await? else { return Ok(None) };
    Ok(Some(serde_json::from_str(&line)?))
}

/// Never where nobody looks.
async fn next_picture(look: &mut Option<Look>) -> Shown {
    if let Some(look) = look
        && let Some(picture) = look.next().await
    {
        return picture;
    }
    std::future::pending().await
}

/// Never where nobody takes them.
async fn next_packet(packets: &mut Option<broadcast::Receiver<Packet>>) -> Packet {
    if let Some(packets) = packets
        && let Some(packet) = camera::next_packet(packets).await
    {
        return packet;
    }
    std::future::pending().await
}

struct Child {
    words: OwnedWriteHalf,
    /// Orders so far.
    heard: u64,
}

impl Child {
    async fn report(&mut self, camera: &Camera) -> io::Result<()> {
        self.say(&Word::Report(Box::new(Report::of(&camera.known, self.heard)))).await
    }

    async fn say_all(&mut self, sightings: &Sightings) -> io::Result<()> {
        while let Some(sighting) = sightings.try_next() {
            sightings.done(&sighting);
            self.say(&Word::Sighting(Box::new(sighting))).await?;
        }
        Ok(())
    }

    async fn say(&mut self, word: &Word) -> io::Result<()> {
        self.words.write_all(&line(word)?).await
    }
}
