// SPDX-License-Identifier: MPL-2.0

//! One of the cameras, what happens to it, and who follows with it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use end_to_end::following::{MJPEG, Network, RTSP};
use end_to_end::scene::{self, left_at_rest};
use end_to_end::{Broker, Chance, Counter, Program, Watchdog, Way};
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

/// How often somebody asks the page for everything.
const VISITS: Duration = Duration::from_secs(1);
const PAGES: [&str; 3] = ["/", "/cameras", "/cameras/door/picture"];
/// What a picture may be as large as.
const SIZES: [&str; 2] = ["320x240", "240x180"];

/// A camera, the ways to it and the program that follows with it.
pub struct Camera {
    number: usize,
    camera: Arc<VirtualCamera>,
    network: Network,
    chance: Chance,
    program: Option<Program>,
    broker: u16,
    watchdog: PathBuf,
    process: Arc<AtomicU32>,
    /// That its programs have built.
    pipelines: Counter,
}

/// How the picture of this camera comes.
fn by_rtsp(number: usize) -> bool {
    number % 4 >= 2
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
    /// Odd ones have programs that are killed now and then; of four the third and fourth speak RTSP.
    pub fn start(number: usize, seed: u64, lasts: Duration, watchdog: &Watchdog, broker: &Broker) -> Self {
        let camera = Arc::new(VirtualCamera::start(scene::walking_person_for(lasts)).unwrap());
        let mut this = Self {
            number,
            network: Network::before(&camera),
            camera,
            chance: Chance::new(seed * 10 + number as u64),
            program: None,
            broker: broker.port,
            watchdog: watchdog.program().to_owned(),
            process: Arc::default(),
            pipelines: Counter::default(),
        };
        this.start_program();
        this
    }

    fn start_program(&mut self) {
        let environment = [("VAPIX_WATCHDOG", self.watchdog.as_path())];
        let file = |folder: &Path| self.file(folder);
        let program = Program::start_in(&format!("soak-{}", self.number), file, &[], &environment);
        self.process.store(program.launch.id(), Ordering::Relaxed);
        self.program = Some(program);
    }

    /// What it is told: to record, and to tell a broker.
    fn file(&self, folder: &Path) -> String {
        let recording = folder.join("recordings");
        let video = match by_rtsp(self.number) {
            true => format!("codec = \"h264\"\nrtsp = \"rtsp://{}\"\n", self.network.rtsp.address()),
            false => String::new(),
        };
        Program::entry("door", &self.network.url(), &folder.join("password"))
            + &video
            + &format!("[camera.door.recording]\nfolder = {recording:?}\nsegment = \"10s\"\nkeep = \"1m\"\n")
            + &format!(
                "[mqtt]\nhost = \"127.0.0.1\"\nport = {}\ntopic = \"soak/{}\"\n",
                self.broker, self.number
            )
    }

    pub fn probe(&self) -> Probe {
        Probe { number: self.number, camera: self.camera.clone(), process: self.process.clone() }
    }

    /// One thing after the other, until it is over.
    pub fn run(mut self, is_over: impl Fn() -> bool) -> Account {
        let mut account = self.account();
        account.came_back("start", self.is_followed(Instant::now()));
        while !is_over() {
            let peace = Duration::from_secs(self.chance.within(PEACE_S));
            self.visit_page(peace);
            let happening = Happening::next(&mut self.chance, self.number % 2 == 1);
            self.let_happen(&happening, &mut account);
            account.came_back(happening.name(), self.is_followed(Instant::now()));
        }
        self.end(account)
    }

    /// Connections that end as soon as there is a picture again, so many times; now and then the settings change.
    pub fn reconnect(mut self, times: u64) -> Account {
        let mut account = self.account();
        account.came_back("start", self.is_followed(Instant::now()));
        let front = if by_rtsp(self.number) { RTSP } else { MJPEG };
        for _ in 0..times {
            let before = front(&self.network).video_requests();
            let happening = match self.chance.within((0, 100)) {
                0 => Happening::Reload,
                even if even % 2 == 0 => Happening::Reset,
                _ => Happening::Close,
            };
            self.visit_page(Duration::ZERO);
            self.let_happen(&happening, &mut account);
            let begin = Instant::now();
            front(&self.network).wait_for_picture(before);
            account.came_back(happening.name(), Some(begin.elapsed()));
        }
        self.end(account)
    }

    fn account(&self) -> Account {
        let known: &[Known] = if by_rtsp(self.number) { OF_RTSPSRC } else { &[] };
        Account::of(self.number, known)
    }

    fn end(mut self, mut account: Account) -> Account {
        self.visit_page(Duration::ZERO);
        if let Some(program) = self.program.take() {
            let (status, output) = program.end_somehow("TERM");
            account.ended(status.success(), &output);
        }
        account.rests(left_at_rest(&self.camera, RESTS));
        account.built(self.pipelines.total());
        account
    }

    /// Somebody looks at the page, and at what it counts, for so long.
    fn visit_page(&mut self, lasts: Duration) {
        let Some(program) = &self.program else { return };
        let begin = Instant::now();
        loop {
            PAGES.iter().for_each(|page| drop(program.ask("GET", page)));
            self.pipelines.is(program.metric("ptztrack_pipelines_total") as u64);
            if begin.elapsed() >= lasts {
                return;
            }
            sleep(VISITS);
        }
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
            Happening::Reload => self.reload(),
            Happening::Kill => self.kill(account),
        }
    }

    /// The file is another, and is read again.
    fn reload(&self) {
        let Some(program) = &self.program else { return };
        let file = program.folder().join("cameras.toml");
        let text = fs::read_to_string(&file).unwrap();
        let [one, other] = SIZES;
        let (from, to) = if text.contains(one) { (one, other) } else { (other, one) };
        fs::write(file, text.replace(from, to)).unwrap();
        program.launch.signal("HUP");
    }

    fn kill(&mut self, account: &mut Account) {
        if let Some(program) = self.program.take() {
            account.said(&program.end_somehow("KILL").1);
        }
        account.rests(left_at_rest(&self.camera, RESTS));
        self.start_program();
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
