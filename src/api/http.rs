//! HTTP for monitoring: `/metrics` and `/healthz`. One GET request per connection.

use super::token::Token;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};

/// Longest accepted request head, bytes.
pub(super) const MAX_HEAD_BYTES: usize = 8 << 10;
const MAX_HEADERS: usize = 64;

/// The requested page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Page {
    Metrics,
    Health,
}

/// Status of a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    Ok,
    BadRequest,
    Unauthorized,
    Forbidden,
    NotFound,
    MethodNotAllowed,
    HeadTooLong,
    Unavailable,
}

/// Reads the head of a request; none while it is incomplete.
pub(super) fn read(head: &[u8], token: Option<&Token>) -> Option<Result<Page, Status>> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(head) {
        Ok(httparse::Status::Partial) if head.len() >= MAX_HEAD_BYTES => return Some(Err(Status::HeadTooLong)),
        Ok(httparse::Status::Partial) => return None,
        Err(httparse::Error::TooManyHeaders) => return Some(Err(Status::HeadTooLong)),
        Err(_) => return Some(Err(Status::BadRequest)),
        Ok(httparse::Status::Complete(_)) => {}
    }
    if token.is_some_and(|token| !bearer(request.headers).is_some_and(|word| token.is(word))) {
        return Some(Err(Status::Unauthorized));
    }
    // A page of another site can have its name lead here (DNS rebinding). It does not have the token.
    if !is_own(request.headers, token.is_some()) {
        return Some(Err(Status::Forbidden));
    }
    let path = request.path.unwrap_or_default();
    Some(match (request.method, path.split('?').next().unwrap_or_default()) {
        (Some("GET"), "/metrics") => Ok(Page::Metrics),
        (Some("GET"), "/healthz") => Ok(Page::Health),
        (_, "/metrics" | "/healthz") => Err(Status::MethodNotAllowed),
        _ => Err(Status::NotFound),
    })
}

/// True if the request comes from no page of another site: it names this server by an address or as localhost, and its page, if it is of one,
/// by the same name. With a token it may use any name.
fn is_own(headers: &[httparse::Header<'_>], has_token: bool) -> bool {
    let values = |name: &'static str| {
        headers.iter().filter(move |header| header.name.eq_ignore_ascii_case(name)).map(|header| header.value)
    };
    let mut hosts = values("host");
    let (host, another) = (hosts.next(), hosts.next());
    let host = host.map(|host| std::str::from_utf8(host).unwrap_or_default());
    let is_named = another.is_none() && host.is_none_or(|host| has_token || is_address(host));
    let is_of = |origin: &[u8]| {
        let origin = std::str::from_utf8(origin).unwrap_or_default();
        origin.strip_prefix("http://").is_some_and(|origin| host.is_some_and(|host| host.eq_ignore_ascii_case(origin)))
    };
    let site = values("sec-fetch-site").all(|site| matches!(site, b"same-origin" | b"none"));
    is_named && site && values("origin").all(is_of)
}

/// True if a `Host` is an IP address or localhost, with or without a port.
fn is_address(host: &str) -> bool {
    let name = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok()).map_or(host, |(name, _)| name);
    let is_v6 = |text: &str| {
        let inside = text.strip_prefix('[').and_then(|text| text.strip_suffix(']'));
        inside.is_some_and(|text| text.parse::<Ipv6Addr>().is_ok())
    };
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok()
        || host.parse::<SocketAddr>().is_ok()
        || is_v6(host)
}

/// The token of `Authorization: Bearer ...`.
fn bearer<'a>(headers: &[httparse::Header<'a>]) -> Option<&'a str> {
    let header = headers.iter().find(|header| header.name.eq_ignore_ascii_case("authorization"))?;
    let (scheme, word) = std::str::from_utf8(header.value).ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(word.trim())
}

/// What the client is told of a request that is not answered.
pub(super) const fn reason(status: Status) -> &'static str {
    match status {
        Status::BadRequest => "refused: this is no HTTP/1.1 request\n",
        Status::Unauthorized => "refused: the token is missing or wrong; send \"Authorization: Bearer TOKEN\"\n",
        Status::Forbidden => {
            "refused: the request is a page's of another site; Host must be an IP address or localhost (with a token any name), \
             and Origin, if there is one, must be http://HOST\n"
        }
        Status::NotFound => "there is no such page; there are /metrics and /healthz\n",
        Status::MethodNotAllowed => "refused: only GET is allowed\n",
        Status::HeadTooLong => "refused: the request's head is larger than 8 KiB or has more than 64 headers\n",
        Status::Ok | Status::Unavailable => "",
    }
}

/// A response as bytes.
pub(super) fn answer(status: Status, body: &str) -> Vec<u8> {
    let (line, more) = match status {
        Status::Ok => ("200 OK", ""),
        Status::BadRequest => ("400 Bad Request", ""),
        Status::Unauthorized => ("401 Unauthorized", "WWW-Authenticate: Bearer\r\n"),
        Status::Forbidden => ("403 Forbidden", ""),
        Status::NotFound => ("404 Not Found", ""),
        Status::MethodNotAllowed => ("405 Method Not Allowed", "Allow: GET\r\n"),
        Status::HeadTooLong => ("431 Request Header Fields Too Large", ""),
        Status::Unavailable => ("503 Service Unavailable", ""),
    };
    let length = body.len();
    format!(
        "HTTP/1.1 {line}\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: {length}\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n{more}\r\n{body}"
    )
    .into_bytes()
}

/// True for the first line of an HTTP request.
pub(super) fn is_http(line: &[u8]) -> bool {
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    line.ends_with(b" HTTP/1.1") || line.ends_with(b" HTTP/1.0") || line.ends_with(b" HTTP/2.0")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_pages_can_be_got() {
        assert_eq!(read(b"GET /metrics HTTP/1.1\r\n\r\n", None), Some(Ok(Page::Metrics)));
        assert_eq!(read(b"GET /healthz?full HTTP/1.0\r\nHost: [::1]\r\n\r\n", None), Some(Ok(Page::Health)));
        assert_eq!(read(b"GET / HTTP/1.1\r\n\r\n", None), Some(Err(Status::NotFound)));
        assert_eq!(read(b"POST /metrics HTTP/1.1\r\n\r\n", None), Some(Err(Status::MethodNotAllowed)));
        assert_eq!(read(b"GET /metrics HTTP/1.1\r\n", None), None);
        assert_eq!(read(b"\x16\x03\x01 hello\r\n\r\n", None), Some(Err(Status::BadRequest)));
        let long = [b"GET /metrics HTTP/1.1\r\nx: ".as_slice(), &[b'x'; MAX_HEAD_BYTES]].concat();
        assert_eq!(read(&long, None), Some(Err(Status::HeadTooLong)));
    }

    #[test]
    fn a_token_comes_before_everything() {
        let token = Token::new("0123456789abcdef");
        let with = |header: &str| read(format!("GET /healthz HTTP/1.1\r\n{header}\r\n").as_bytes(), Some(&token));
        assert_eq!(with("Authorization: Bearer 0123456789abcdef\r\n"), Some(Ok(Page::Health)));
        for header in ["", "Authorization: Bearer 0123456789abcdee\r\n", "Authorization: Basic 0123456789abcdef\r\n"] {
            assert_eq!(with(header), Some(Err(Status::Unauthorized)), "{header}");
        }
    }

    #[test]
    fn pages_of_other_sites_get_nothing() {
        let token = Token::new("0123456789abcdef");
        let get = |headers: &str, token| read(format!("GET /metrics HTTP/1.1\r\n{headers}\r\n").as_bytes(), token);
        let own = [
            "",
            "Host: 127.0.0.1:9879\r\n",
            "Host: LOCALHOST\r\n",
            "Host: [::1]:9879\r\n",
            "Host: 192.168.1.7\r\n",
            "Host: localhost:9879\r\nOrigin: http://localhost:9879\r\nSec-Fetch-Site: same-origin\r\n",
        ];
        for headers in own {
            assert_eq!(get(headers, None), Some(Ok(Page::Metrics)), "{headers}");
        }
        let others = [
            "Host: evil.example:9879\r\n",
            "Host: \r\n",
            "Host: 127.0.0.1.evil.example\r\n",
            "Host: localhost.evil.example:9879\r\n",
            "Host: 127.0.0.1\r\nHost: evil.example\r\n",
            "Host: 127.0.0.1:9879\r\nOrigin: http://evil.example\r\n",
            "Host: 127.0.0.1:9879\r\nOrigin: http://127.0.0.1:8000\r\n",
            "Host: 127.0.0.1:9879\r\nOrigin: null\r\n",
            "Host: 127.0.0.1:9879\r\nSec-Fetch-Site: cross-site\r\n",
        ];
        for headers in others {
            assert_eq!(get(headers, None), Some(Err(Status::Forbidden)), "{headers}");
        }
        let refused = String::from_utf8(answer(Status::Forbidden, reason(Status::Forbidden))).unwrap();
        let (head, body) = refused.split_once("\r\n\r\n").unwrap();
        assert!(head.contains(&format!("\r\nContent-Length: {}\r\n", body.len())), "{refused}");
        assert!(body.contains("another site") && body.contains("IP address or localhost"), "{refused}");
        let named = "Host: robot.lan:9879\r\nAuthorization: Bearer 0123456789abcdef\r\n";
        assert_eq!(get(named, Some(&token)), Some(Ok(Page::Metrics)), "with the token any name");
    }

    proptest! {
        #[test]
        fn any_bytes_are_answered_or_waited_for(head: Vec<u8>) {
            if let Some(Err(status)) = read(&head, None) {
                prop_assert!(reason(status).ends_with('\n'));
                prop_assert!(answer(status, reason(status)).starts_with(b"HTTP/1.1 4"));
            }
        }
    }
}
