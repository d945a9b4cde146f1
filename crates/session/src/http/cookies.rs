// SPDX-License-Identifier: MPL-2.0

use reqwest::header::{COOKIE, HeaderMap, HeaderValue, SET_COOKIE};
use serde::{Deserialize, Serialize};

/// What a camera is reminded of that has set a cookie with this header; `None`: of nothing.
pub fn answer_to_cookie(header: &str) -> Option<String> {
    let header = HeaderValue::from_str(header).ok()?;
    let mut cookies = Cookies::default();
    cookies.take(&HeaderMap::from_iter([(SET_COOKIE, header)]));
    let mut request = HeaderMap::new();
    cookies.put(&mut request);
    Some(request.get(COOKIE)?.to_str().ok()?.to_owned())
}

/// Remembers what the camera asks to be reminded of: with a control queue that is who we are.
///
/// For one camera only, until the end; and few, so that no camera can fill the memory.
#[derive(Debug, Default, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Cookies(Vec<(String, String)>);

impl Cookies {
    /// Cameras set one or two; together they stay near the 8 KiB that servers take for a header.
    const MOST: usize = 8;
    const LONGEST_BYTES: usize = 1024;

    /// Takes those of an answer.
    pub fn take(&mut self, headers: &HeaderMap) {
        for header in headers.get_all(SET_COOKIE) {
            // Path, age and the like behind it do not matter to one camera's CGIs.
            let pair = header.to_str().ok().and_then(|text| text.split(';').next()?.trim().split_once('='));
            let Some((name, value)) = pair
                .filter(|(name, value)| !name.is_empty() && name.len() + value.len() <= Self::LONGEST_BYTES)
            else {
                continue;
            };
            self.0.retain(|(known, _)| known != name);
            if self.0.len() == Self::MOST {
                self.0.remove(0);
            }
            self.0.push((name.to_owned(), value.to_owned()));
        }
    }

    /// Puts them into a request.
    pub fn put(&self, headers: &mut HeaderMap) {
        let pairs: Vec<String> = self.0.iter().map(|(name, value)| format!("{name}={value}")).collect();
        if let Ok(value) = HeaderValue::from_str(&pairs.join("; "))
            && !pairs.is_empty()
        {
            headers.insert(COOKIE, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn take(cookies: &mut Cookies, text: &str) {
        let mut headers = HeaderMap::new();
        headers.append(SET_COOKIE, HeaderValue::from_str(text).unwrap());
        cookies.take(&headers);
    }

    fn put(cookies: &Cookies) -> Option<String> {
        let mut headers = HeaderMap::new();
        cookies.put(&mut headers);
        headers.get(COOKIE).map(|value| value.to_str().unwrap().to_owned())
    }

    #[test]
    fn cookies_are_given_back_the_newest_of_each_name() {
        let mut cookies = Cookies::default();
        assert_eq!(put(&cookies), None);
        take(&mut cookies, "ptzctl=17; path=/; HttpOnly");
        take(&mut cookies, "other=a=b");
        take(&mut cookies, "ptzctl=18");
        assert_eq!(put(&cookies).as_deref(), Some("other=a=b; ptzctl=18"));
    }

    #[test]
    fn nonsense_and_masses_are_not_kept() {
        let mut cookies = Cookies::default();
        for text in ["", "x", "=1", &format!("long={}", "x".repeat(2000))] {
            take(&mut cookies, text);
        }
        assert_eq!(put(&cookies), None);
        for number in 0..1000 {
            take(&mut cookies, &format!("c{number}=1"));
        }
        assert_eq!(cookies.0.len(), Cookies::MOST);
    }

    proptest! {
        /// A camera makes no header of its own, and no longer one than is kept.
        #[test]
        fn any_text_is_kept_or_not(header in "([a-z]{1,8}|=|;|path=/|, |\"|é|.){0,24}") {
            if let Some(cookie) = answer_to_cookie(&header) {
                let (name, value) = cookie.split_once('=').unwrap();
                prop_assert!(!name.is_empty() && header.contains(name) && header.contains(value));
                prop_assert!(!cookie.contains(';') && cookie.len() <= Cookies::LONGEST_BYTES + 1);
            }
        }
    }
}
