// SPDX-License-Identifier: MPL-2.0

//! One of the cameras, what happens to it, and who follows with it.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use end_to_end::following::Network;
use end_to_end::scene::{self, left_at_rest};
use end_to_end::{Chance, GstLaunch, Watchdog, Way, plugin_folder, tool};
use virtual_camera::{Fault, VirtualCamera};

use crate::account::Account;
use crate::fault::Happening;
use crate::known::{Known, OF_RTSPSRC};

/// From the end of one thing to the next, s.
const PEACE_S: (u64, u64) = (4, 16);
/// What is not back by then is lost.
const LOST: Duration = Duration::from_secs(60);
/// A camera of a dead application rests by then: a lease, and what a busy machine needs.
const RESTS: Duration = Duration::from_secs(10);

/// A camera, the ways to it and who follows with it.
pub struct Camera {
    number: usize,
    camera: Arc<VirtualCamera>,
    network: Network,
    chance: Chance,
    follower: Option<GstLaunch>,
    command: Command,
    process: Arc<AtomicU32>,
}

/// How the picture of this camera comes.
fn by_rtsp(number: usize) -> bool {
    number >= 2
}

/// What samples are taken of.
pub struct Probe {
    /// From 0.
    pub number: usize,
    pub camera: Arc<VirtualCamera>,
    /// Who follows now.
    pub process: Arc<AtomicU32>,
}

impl Camera {
    /// Odd ones have followers that are killed now and then; the third and fourth speak RTSP.
    pub fn start(number: usize, seed: u64, duration: Duration, watchdog: &Watchdog) -> Self {
        let settings = scene::walking_person_for(duration + 4 * LOST);
        let camera = Arc::new(VirtualCamera::start(settings).unwrap());
        let network = Network::before(&camera);
        let seed = seed * 10 + number as u64;
        let mut command = watchdog.of(tool(plugin_folder().join("unattended").to_str().unwrap()));
        command.args([if by_rtsp(number) { "h264" } else { "mjpeg" }, &seed.to_string()]);
        network.surround(&mut command);
        let follower = GstLaunch::spawn(&mut command);
        let process = Arc::new(AtomicU32::new(follower.id()));
        let chance = Chance::new(seed);
        Self { number, camera, network, chance, follower: Some(follower), command, process }
    }

    pub fn probe(&self) -> Probe {
        Probe { number: self.number, camera: self.camera.clone(), process: self.process.clone() }
    }

    /// One thing after the other, until it is over.
    pub fn run(mut self, over: &AtomicBool) -> Account {
        let known: &[Known] = if by_rtsp(self.number) { OF_RTSPSRC } else { &[] };
        let mut account = Account::of(self.number, known);
        account.came_back("start", self.is_followed(Instant::now()));
        while !over.load(Ordering::Relaxed) {
            sleep(Duration::from_secs(self.chance.within(PEACE_S)));
            let happening = Happening::next(&mut self.chance, self.number % 2 == 1);
            self.let_happen(&happening, &mut account);
            account.came_back(happening.name(), self.is_followed(Instant::now()));
        }
        let follower = self.follower.take().unwrap();
        follower.signal("TERM");
        let (status, output) = follower.finish();
        account.ended(status.success(), &output);
        account.rests(left_at_rest(&self.camera, RESTS));
        account
    }

    fn let_happen(&mut self, happening: &Happening, account: &mut Account) {
        let lasts = happening.lasts(&mut self.chance);
        match happening {
            Happening::Network(way) => {
                self.network.set(*way);
                sleep(lasts);
                self.network.set(Way::Open);
            }
            Happening::Reset => self.network.reset(),
            Happening::Close => self.network.close(),
            Happening::Reboot => {
                self.camera.set_fault(Fault::Reboot);
                self.network.set(Way::Refused);
                sleep(lasts);
                self.camera.set_fault(Fault::None);
                self.network.set(Way::Open);
            }
            Happening::Answers(fault) => {
                self.camera.set_fault(fault.clone());
                sleep(lasts);
                self.camera.set_fault(Fault::None);
            }
            Happening::Operator => {
                let turn = if self.camera.status().pan_deg > 0.0 { "rpan=-12" } else { "rpan=12" };
                self.camera.operate(turn);
            }
            Happening::Forget => self.camera.forget_rtsp_sessions(),
            Happening::Kill => self.kill(account),
        }
    }

    fn kill(&mut self, account: &mut Account) {
        if let Some(follower) = self.follower.take() {
            follower.signal("KILL");
            let (_, output) = follower.finish();
            account.said(&output);
        }
        account.rests(left_at_rest(&self.camera, RESTS));
        let follower = GstLaunch::spawn(&mut self.command);
        self.process.store(follower.id(), Ordering::Relaxed);
        self.follower = Some(follower);
    }

    /// How long until it is moved again, where it is.
    fn is_followed(&self, since: Instant) -> Option<Duration> {
        let mut seen = self.camera.status().commands;
        loop {
            let commands = self.camera.commands_after(seen);
            let moves = |query: &str| query.contains("move=") && !query.contains("move=0,0");
            if commands.iter().any(|command| command.status == 204 && moves(&command.query)) {
                return Some(since.elapsed());
            }
            seen = commands.last().map_or(seen, |command| command.number);
            let left = LOST.checked_sub(since.elapsed())?;
            if !self.camera.wait_for(left, |status| status.commands > seen) {
                return None;
            }
        }
    }
}
