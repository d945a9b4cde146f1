// SPDX-License-Identifier: MPL-2.0

//! `ptztrack point`: tells the program that runs what a camera looks at, by its page.

use std::net::SocketAddr;
use std::path::PathBuf;

use axum::body::Body;
use axum::http::{Request, Response, StatusCode, header};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use clap::Args;
use hyper::body::Incoming;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio::net::TcpStream;

use crate::config::{Http, Secret};

#[derive(Debug, Args)]
pub struct Point {
    /// The camera that is called; the middle of its picture shows the place
    camera: String,
    /// The camera that calls it
    from: String,
    /// The place in the picture of that: parts of it from the left and from the top, as 0.4,0.7
    #[arg(value_parser = place)]
    place: Place,
    /// The place in the picture of the camera that is called, where that is not its middle
    #[arg(long, value_parser = place, default_value = "0.5,0.5")]
    here: Place,
    /// Where the program that runs has its page
    #[arg(long, value_name = "ADDRESS:PORT", default_value_t = Http::LISTEN)]
    http: SocketAddr,
    /// User of the page, where it has one
    #[arg(long, requires = "password_file")]
    user: Option<String>,
    /// File with the password of the page
    #[arg(long, value_name = "FILE", requires = "user")]
    password_file: Option<PathBuf>,
}

/// Parts of a picture, from the left and from the top.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    x: f64,
    y: f64,
}

impl Point {
    /// Says so, and what is answered.
    ///
    /// # Errors
    /// Why it was not heard, or cannot be, in words.
    pub async fn say(&self) -> Result<String, String> {
        let nobody = |err: &dyn std::fmt::Display| {
            format!("no ptztrack has its page at {}: {err}. Start it, or say where by --http", self.http)
        };
        let stream = TcpStream::connect(self.http).await.map_err(|err| nobody(&err))?;
        let (mut sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(|err| nobody(&err))?;
        tokio::spawn(connection);
        let request = self.request().map_err(|err| err.to_string())?;
        let answer = sender.send_request(request).await.map_err(|err| nobody(&err))?;
        match answer.status() {
            StatusCode::OK => Ok(text(answer).await),
            StatusCode::CONFLICT => Err(text(answer).await.trim_end().to_owned()),
            StatusCode::UNAUTHORIZED => {
                Err("the page wants a password: give --user and --password-file".to_owned())
            }
            StatusCode::NOT_FOUND => {
                Err(format!("there is no camera `{}` or no camera `{}`", self.camera, self.from))
            }
            other => Err(format!("the page answers: {other}")),
        }
    }

    fn request(&self) -> Result<Request<Body>, Box<dyn std::error::Error>> {
        let Place { x, y } = self.place;
        let here = self.here;
        let path = format!(
            "/cameras/{}/point?from={}&x={x}&y={y}&here_x={}&here_y={}",
            self.camera, self.from, here.x, here.y
        );
        let request = Request::post(path).header(header::HOST, self.http.to_string());
        let request = match (&self.user, &self.password_file) {
            (Some(user), Some(file)) => {
                let password = Secret::from_file(file)?;
                let proof = BASE64_STANDARD.encode(format!("{user}:{}", password.reveal()));
                request.header(header::AUTHORIZATION, format!("Basic {proof}"))
            }
            _ => request,
        };
        Ok(request.body(Body::empty())?)
    }
}

/// What the page says.
async fn text(answer: Response<Incoming>) -> String {
    const LONGEST: usize = 4096;
    let body = axum::body::to_bytes(Body::new(answer.into_body()), LONGEST).await.unwrap_or_default();
    String::from_utf8_lossy(&body).into_owned()
}

fn place(text: &str) -> Result<Place, &'static str> {
    let part = |text: &str| text.trim().parse().ok().filter(|part: &f64| (0.0..=1.0).contains(part));
    let both = text.split_once(',').and_then(|(x, y)| Some(Place { x: part(x)?, y: part(y)? }));
    both.ok_or("two numbers from 0 to 1, as 0.4,0.7")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_two_parts_of_a_picture() {
        assert_eq!(place("0.4,0.7"), Ok(Place { x: 0.4, y: 0.7 }));
        for wrong in ["", "0.4", "0.4,1.7", "a,b", "0.1,0.2,0.3", "NaN,0.1"] {
            assert!(place(wrong).is_err(), "{wrong}");
        }
    }
}
