use super::*;

fn request(headers: &str) -> Vec<u8> {
    format!("POST /rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages HTTP/1.1\r\n{headers}\r\nbody").into()
}

#[test]
fn viewers_come_in_and_pages_of_other_sites_do_not() {
    let pages = ["http://127.0.0.1:4000".to_owned()];
    let is_in = |headers: &str| matches!(judge(&request(headers), &pages), Verdict::Pass(_));
    assert!(is_in("Host: 127.0.0.1:9877\r\n"));
    assert!(is_in("Host: 127.0.0.1:9877\r\nOrigin: http://127.0.0.1:4000\r\n"), "the web viewer's page");
    assert!(is_in("Host: localhost:9877\r\nOrigin: http://localhost:9877\r\n"));
    for headers in [
        "",
        "Host: evil.example:9877\r\n",
        "Host: evil.example:9877\r\nOrigin: http://evil.example:9877\r\n",
        "Host: 127.0.0.1:9877\r\nOrigin: http://127.0.0.1:8000\r\n",
        "Host: 127.0.0.1:9877\r\nOrigin: https://app.rerun.io\r\n",
        "Host: 127.0.0.1:9877\r\nOrigin: null\r\n",
        "Host: 127.0.0.1:9877\r\nHost: evil.example\r\n",
        "Host: 127.0.0.1:9877\r\nOrigin: http://127.0.0.1:9877\r\nOrigin: http://evil.example\r\n",
    ] {
        assert_eq!(judge(&request(headers), &pages), Verdict::Refuse, "{headers}");
    }
    assert_eq!(judge(&PREFACE[..10], &pages), Verdict::Wait);
    assert_eq!(judge(PREFACE, &pages), Verdict::Pass(PREFACE.to_vec()));
    assert_eq!(judge(b"\x16\x03\x01 hello", &pages), Verdict::Refuse);
}

#[test]
fn a_connection_of_a_browser_has_one_request_and_no_other_protocol() {
    let asked = request("Host: [::1]:9877\r\nConnection: Upgrade, keep-alive\r\nUpgrade: h2c\r\nX: y\r\n");
    let Verdict::Pass(forwarded) = judge(&asked, &[]) else { panic!("it is refused") };
    let text = String::from_utf8(forwarded).unwrap();
    assert!(text.ends_with("Host: [::1]:9877\r\nX: y\r\nConnection: close\r\n\r\nbody"), "{text}");
    assert!(!text.contains("Upgrade") && !text.contains("keep-alive"), "{text}");
}

/// A server that answers each byte with itself.
fn echo() -> SocketAddr {
    let listener = TcpListener::bind(hidden_address().unwrap()).unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            std::thread::spawn(move || io::copy(&mut stream.try_clone().unwrap(), &mut &stream));
        }
    });
    address
}

#[test]
fn bytes_pass_both_ways_and_connections_are_limited() {
    let behind = echo();
    assert!(behind.ip().is_loopback());
    let door = Door::open((Ipv4Addr::LOCALHOST, 0).into(), behind).unwrap();
    let mut viewers = Vec::new();
    for _ in 0..MAX_CONNECTIONS {
        let mut stream = TcpStream::connect(door.address).unwrap();
        stream.write_all(PREFACE).unwrap();
        stream.write_all(b"frames").unwrap();
        let mut answer = [0; PREFACE.len() + 6];
        stream.read_exact(&mut answer).unwrap();
        assert!(answer.ends_with(b"frames"));
        viewers.push(stream);
    }
    let mut surplus = TcpStream::connect(door.address).unwrap();
    let _ = surplus.write_all(PREFACE);
    assert!(matches!(surplus.read(&mut [0; 1]), Ok(0) | Err(_)), "it is closed");
    viewers.pop();
    let refused = || {
        let mut stream = TcpStream::connect(door.address).unwrap();
        let _ = stream.write_all(&request("Host: evil.example\r\n"));
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        answer
    };
    // The place is free as soon as the door has noticed.
    let answer = std::iter::repeat_with(refused).find(|answer| !answer.is_empty()).unwrap();
    let answer = String::from_utf8(answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 403 Forbidden\r\n"), "{answer}");
    assert!(answer.ends_with(REFUSED) && REFUSED.contains("Host must be an IP address or localhost"), "{answer}");
    let address = door.address;
    drop((door, viewers));
    while TcpListener::bind(address).is_err() {}
}

fn answer(address: SocketAddr, asked: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    stream.write_all(asked.as_bytes()).unwrap();
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    answer
}

#[test]
fn reruns_server_answers_viewers_and_its_own_pages_alone() {
    let address = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap();
    let identity = crate::Identity { recording: "door".into(), name: "door".into(), unix_zero_us: None };
    let mut viewer = crate::Viewer::new(identity, false);
    assert!(viewer.serve(address));
    let mut native = TcpStream::connect(address).unwrap();
    native.write_all(PREFACE).unwrap();
    // An empty SETTINGS frame, which is answered with the server's.
    native.write_all(&[0, 0, 0, 4, 0, 0, 0, 0, 0]).unwrap();
    let mut frame = [0; 9];
    native.read_exact(&mut frame).unwrap();
    assert_eq!(frame[3], 4, "{frame:?}");
    let preflight = |host: &str, origin: &str| {
        format!(
            "OPTIONS /rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages HTTP/1.1\r\nHost: {host}\r\n\
             Origin: {origin}\r\nAccess-Control-Request-Method: POST\r\n\r\n"
        )
    };
    let (own, page) = (address.to_string(), format!("http://{address}"));
    // Two requests at once: the second one is not read.
    let twice = preflight(&own, &page) + &preflight("evil.example", "http://evil.example");
    let well = answer(address, &twice);
    assert!(well.starts_with("HTTP/1.1 200") && well.matches("HTTP/1.1").count() == 1, "{well}");
    for (host, origin) in [("evil.example", "http://evil.example"), (own.as_str(), "http://127.0.0.1:8000")] {
        let refused = answer(address, &preflight(host, origin));
        assert!(refused.starts_with("HTTP/1.1 403") && !refused.contains("access-control"), "{refused}");
    }
    drop(native);
    viewer.finish(Duration::from_secs(2));
    while TcpListener::bind(address).is_err() {}
}

#[test]
fn an_address_of_the_network_has_few_places_and_this_computer_all() {
    let door = Door::open((Ipv4Addr::LOCALHOST, 0).into(), hidden_address().unwrap()).unwrap();
    let far = IpAddr::from([192, 0, 2, 1]);
    let mut held: Vec<_> = (0..MAX_OF_ADDRESS).map(|_| Place::new(&door.shared, far).unwrap()).collect();
    assert!(Place::new(&door.shared, far).is_none());
    held.extend(
        (MAX_OF_ADDRESS..MAX_CONNECTIONS).map(|_| Place::new(&door.shared, Ipv4Addr::LOCALHOST.into()).unwrap()),
    );
    assert!(Place::new(&door.shared, Ipv4Addr::LOCALHOST.into()).is_none());
    held.remove(0);
    assert!(Place::new(&door.shared, far).is_some());
}
