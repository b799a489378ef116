//! HTTP for monitoring: `/metrics` and `/healthz`. One GET request per connection.

use super::token::Token;

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
    let path = request.path.unwrap_or_default();
    Some(match (request.method, path.split('?').next().unwrap_or_default()) {
        (Some("GET"), "/metrics") => Ok(Page::Metrics),
        (Some("GET"), "/healthz") => Ok(Page::Health),
        (_, "/metrics" | "/healthz") => Err(Status::MethodNotAllowed),
        _ => Err(Status::NotFound),
    })
}

/// The token of `Authorization: Bearer ...`.
fn bearer<'a>(headers: &[httparse::Header<'a>]) -> Option<&'a str> {
    let header = headers.iter().find(|header| header.name.eq_ignore_ascii_case("authorization"))?;
    let (scheme, word) = std::str::from_utf8(header.value).ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(word.trim())
}

/// A response as bytes.
pub(super) fn answer(status: Status, body: &str) -> Vec<u8> {
    let (line, more) = match status {
        Status::Ok => ("200 OK", ""),
        Status::BadRequest => ("400 Bad Request", ""),
        Status::Unauthorized => ("401 Unauthorized", "WWW-Authenticate: Bearer\r\n"),
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_pages_can_be_got() {
        assert_eq!(read(b"GET /metrics HTTP/1.1\r\n\r\n", None), Some(Ok(Page::Metrics)));
        assert_eq!(read(b"GET /healthz?full HTTP/1.0\r\nHost: x\r\n\r\n", None), Some(Ok(Page::Health)));
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

    proptest! {
        #[test]
        fn any_bytes_are_answered_or_waited_for(head: Vec<u8>) {
            if let Some(Err(status)) = read(&head, None) {
                prop_assert!(answer(status, "").starts_with(b"HTTP/1.1 4"));
            }
        }
    }
}
