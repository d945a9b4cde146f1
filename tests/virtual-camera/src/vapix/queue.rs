// SPDX-License-Identifier: MPL-2.0

//! `ptzqueue.cgi`: who may move the camera where several want to.

use std::time::Duration;

use super::{Args, CgiResponse};

/// Who stands in line. The first is in control; whoever is not heard of for a while is out.
#[derive(Debug)]
pub(crate) struct Queue {
    poll: Duration,
    line: Vec<Client>,
    /// Clients so far: each gets its own cookie.
    known: u64,
}

#[derive(Debug)]
struct Client {
    id: u64,
    heard: Duration,
}

/// The client that needs no cookie: an operator of higher priority than all others.
const OPERATOR: u64 = 0;

impl Queue {
    /// The name of the cookie.
    pub const COOKIE: &'static str = "ptzctl";

    /// Clients must ask at least this often.
    pub fn new(poll: Duration) -> Self {
        Self { poll, line: Vec::new(), known: 0 }
    }

    /// An operator steps to the front of the line, or leaves it.
    pub fn operator(&mut self, there: bool) {
        self.line.retain(|client| client.id != OPERATOR);
        if there {
            self.line.insert(0, Client { id: OPERATOR, heard: Duration::MAX });
        }
    }

    /// What keeps the client with this cookie from `ptz.cgi`; `moves`: it wants more than to know something.
    pub fn objection(&mut self, cookie: Option<&str>, moves: bool, now: Duration) -> Option<String> {
        self.forget_silent(now);
        match self.id(cookie) {
            None => Some("cookie required".into()),
            Some(id) if moves && self.place(id) != 1 => Some("not in control".into()),
            Some(_) => None,
        }
    }

    /// `ptzqueue.cgi` with `args`.
    pub fn answer(&mut self, args: &Args, cookie: Option<&str>, now: Duration) -> CgiResponse {
        self.forget_silent(now);
        let control = args.iter().find(|arg| arg.0 == "control").map_or("", |arg| arg.1.as_str());
        let id = self.id(cookie);
        match (control, id) {
            ("request", _) => {
                let id = id.unwrap_or_else(|| {
                    self.known += 1;
                    self.known
                });
                self.hear(id, now);
                if self.place(id) == 0 {
                    self.line.push(Client { id, heard: now });
                }
                CgiResponse::Introduced {
                    cookie: format!("{}={id}; path=/", Self::COOKIE),
                    text: self.tell(id),
                }
            }
            ("query", Some(id)) => {
                self.hear(id, now);
                CgiResponse::Text(self.tell(id))
            }
            ("drop", Some(id)) => {
                self.line.retain(|client| client.id != id);
                CgiResponse::Accepted
            }
            ("query" | "drop", None) => CgiResponse::error("cookie required"),
            _ => CgiResponse::error(format!("control: invalid value: {control}")),
        }
    }

    fn tell(&self, id: u64) -> String {
        let poll = self.poll.as_secs();
        format!("<a name=\"{}\"></a>\r\n<a name=\"-1\"></a>\r\n<a name=\"{poll}\"></a>\r\n", self.place(id))
    }

    /// 1 is in control, 0 out of line.
    fn place(&self, id: u64) -> usize {
        self.line.iter().position(|client| client.id == id).map_or(0, |before| before + 1)
    }

    fn hear(&mut self, id: u64, now: Duration) {
        if let Some(client) = self.line.iter_mut().find(|client| client.id == id) {
            client.heard = now;
        }
    }

    fn forget_silent(&mut self, now: Duration) {
        self.line.retain(|client| now <= client.heard.saturating_add(self.poll));
    }

    fn id(&self, cookie: Option<&str>) -> Option<u64> {
        let id = cookie?.parse().ok()?;
        (OPERATOR < id && id <= self.known).then_some(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vapix::parse_args;

    fn s(s: u64) -> Duration {
        Duration::from_secs(s)
    }

    fn ask(queue: &mut Queue, control: &str, cookie: Option<&str>, now: Duration) -> String {
        match queue.answer(&parse_args(format!("control={control}").as_bytes()), cookie, now) {
            CgiResponse::Text(text) | CgiResponse::Introduced { text, .. } => text.chars().take(12).collect(),
            CgiResponse::Accepted => "yes".into(),
        }
    }

    #[test]
    fn the_first_in_line_is_in_control_and_the_silent_are_out() {
        let mut queue = Queue::new(s(20));
        assert_eq!(ask(&mut queue, "request", None, s(0)), "<a name=\"1\">");
        assert_eq!(ask(&mut queue, "request", None, s(1)), "<a name=\"2\">");
        assert_eq!(queue.objection(Some("1"), true, s(1)), None);
        assert_eq!(queue.objection(Some("2"), true, s(1)), Some("not in control".into()));
        assert_eq!(queue.objection(Some("2"), false, s(1)), None);
        assert_eq!(queue.objection(None, false, s(1)), Some("cookie required".into()));
        assert_eq!(queue.objection(Some("3"), false, s(1)), Some("cookie required".into()));
        assert_eq!(ask(&mut queue, "query", Some("2"), s(15)), "<a name=\"2\">");
        assert_eq!(ask(&mut queue, "query", Some("2"), s(21)), "<a name=\"1\">");
        assert_eq!(ask(&mut queue, "query", Some("1"), s(21)), "<a name=\"0\">");
        assert_eq!(ask(&mut queue, "drop", Some("2"), s(22)), "yes");
        assert_eq!(ask(&mut queue, "query", Some("2"), s(22)), "<a name=\"0\">");
    }

    #[test]
    fn an_operator_goes_before() {
        let mut queue = Queue::new(s(20));
        ask(&mut queue, "request", None, s(0));
        queue.operator(true);
        assert_eq!(ask(&mut queue, "query", Some("1"), s(10)), "<a name=\"2\">");
        queue.operator(false);
        assert_eq!(ask(&mut queue, "query", Some("1"), s(20)), "<a name=\"1\">");
    }

    #[test]
    fn nonsense_is_refused() {
        let mut queue = Queue::new(s(20));
        for (control, cookie) in [("query", None), ("drop", Some("x")), ("", Some("1")), ("query", Some("0"))]
        {
            assert!(ask(&mut queue, control, cookie, s(0)).starts_with("Error:"), "{control} {cookie:?}");
        }
    }
}
