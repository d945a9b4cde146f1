// SPDX-License-Identifier: MPL-2.0

//! The control queue: who may move the camera where several want to (`ptzqueue.cgi`).

use std::time::Duration;

use session::http::unexpected;
use session::{Error, QueuePlace, QueueRequest};

use crate::text::complaint;

/// A request as `ptzqueue.cgi` takes it.
pub(super) fn control(request: QueueRequest) -> &'static str {
    match request {
        QueueRequest::Request => "request",
        QueueRequest::Drop => "drop",
        QueueRequest::Query => "query",
    }
}

/// The shortest and longest that a camera can be set to (`PTZ.Various.V#.CtlQueuePollTime`).
const POLL_S: (i64, i64) = (5, 3600);

/// Reads `<a name="POSITION"></a><a name="SECONDS"></a><a name="PERIOD"></a>`.
///
/// # Errors
/// [`Error::Camera`] with the camera's `Error:`, [`Error::Unexpected`] where it is of another form.
pub fn parse_queue_place(body: &str) -> Result<QueuePlace, Error> {
    if let Some(text) = complaint(body) {
        return Err(Error::Camera(text));
    }
    let mut numbers = body.split("name=\"").skip(1).map(|rest| rest.split('"').next()?.parse::<i64>().ok());
    let (Some(Some(position)), Some(Some(_)), Some(Some(period))) =
        (numbers.next(), numbers.next(), numbers.next())
    else {
        return Err(unexpected(body));
    };
    Ok(QueuePlace {
        position: u32::try_from(position).map_err(|_| unexpected(body))?,
        poll_every: Duration::from_secs(period.clamp(POLL_S.0, POLL_S.1).unsigned_abs()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_documented_answer_is_read() {
        let place = parse_queue_place(r#"<a name="3"></a><a name="410"></a><a name="5"></a>"#).unwrap();
        assert_eq!(place.position, 3);
        assert_eq!(place.poll_every, Duration::from_secs(5));
        let first = parse_queue_place("<a name=\"1\"></a>\r\n<a name=\"-1\"></a>\r\n<a name=\"20\"></a>\r\n");
        assert_eq!(first.map(|place| place.position), Ok(1));
    }

    #[test]
    fn refusals_and_nonsense_are_errors() {
        assert_eq!(parse_queue_place("Error:queue full"), Err(Error::Camera("queue full".to_owned())));
        for body in ["", r#"<a name="1"></a>"#, r#"<a name="x"></a><a name="1"></a><a name="5"></a>"#] {
            assert!(matches!(parse_queue_place(body), Err(Error::Unexpected(_))), "{body}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(body in "(<a name=\"|\"></a>|-|[0-9]{1,24}|name=|\"|Error:|x){0,24}") {
            if let Ok(place) = parse_queue_place(&body) {
                prop_assert!((5..=3600).contains(&place.poll_every.as_secs()));
            }
        }

        #[test]
        fn a_place_is_read_back(position in 0u32..100, left in -1i64..100_000, period in 5u64..=3600) {
            let body = format!("<a name=\"{position}\"></a><a name=\"{left}\"></a><a name=\"{period}\"></a>");
            let place = parse_queue_place(&body).unwrap();
            prop_assert_eq!(place.position, position);
            prop_assert_eq!(place.poll_every.as_secs(), period);
        }
    }
}
