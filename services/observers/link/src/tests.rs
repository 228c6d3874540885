//! Tests of both ends of a topic over the network layer, on this machine.

mod buffers;

use std::{
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use gyre_client::RecordedMessage;
use gyre_contract::{Item, flag, run::LinkConfig};
use zenoh::{Session, Wait, qos::Priority};

use crate::{
    fetch::{Fetcher, Request},
    replay_buffer::{MemoryBuffer, ReplayBuffer},
    serve::{Offer, Server},
    session,
    waker::Waker,
};

const MAX_WAIT: Duration = Duration::from_secs(180);

fn add(buffer: &MemoryBuffer, seq: u64) {
    add_item(buffer, &Item::numbered(seq));
}

fn add_item(buffer: &MemoryBuffer, item: &Item) {
    buffer.add(&RecordedMessage {
        header: bytemuck::bytes_of(item).to_vec(),
        payload: Vec::new(),
    });
}

/// Returns an address that stays free: those who connect take their ports on 127.0.0.1.
fn endpoint() -> String {
    let listener = TcpListener::bind("127.0.0.2:0").unwrap();
    format!("tcp/{}", listener.local_addr().unwrap())
}

fn open(link: LinkConfig) -> Session {
    let pause = || {
        thread::sleep(Duration::from_millis(5));
        Ok(false)
    };
    session::open(&link, pause).unwrap().unwrap()
}

fn network(listen: &[&str], connect: &[&str]) -> LinkConfig {
    let [listen, connect] = [listen, connect].map(|all| all.iter().map(|&it| it.into()).collect());
    LinkConfig {
        name: "test".to_owned(),
        listen,
        connect,
        ..LinkConfig::default()
    }
}

fn listening(endpoint: &str) -> LinkConfig {
    network(&[endpoint], &[])
}

fn connecting(endpoint: &str) -> LinkConfig {
    network(&[], &[endpoint])
}

fn fetcher(session: &Session, from: u64) -> Fetcher {
    fetching(session, from, 0, session.zid().to_string())
}

fn fetching(session: &Session, from: u64, generation: u32, receiver: String) -> Fetcher {
    let request = Request {
        key: "gyre/test/topic".to_owned(),
        from,
        generation: Some(generation),
        receiver,
        priority: Priority::Data,
    };
    Fetcher::start(session, request, Waker::new().unwrap())
}

/// Waits until so many messages have come.
fn items(fetcher: &Fetcher, count: usize) -> Vec<Item> {
    let mut taken = Vec::new();
    until("all messages have come", || {
        taken.extend(fetcher.next());
        taken.len() == count
    });
    let item = |bytes: Vec<u8>| bytemuck::pod_read_unaligned::<Item>(&bytes[..size_of::<Item>()]);
    taken.into_iter().map(item).collect()
}

fn take(fetcher: &Fetcher, count: usize) -> Vec<u64> {
    let items = items(fetcher, count).into_iter();
    items.map(|item| item.seq).collect()
}

/// Waits for so many messages, and returns their generations and numbers.
fn take_of_generations(fetcher: &Fetcher, count: usize) -> Vec<(u32, u64)> {
    let items = items(fetcher, count).into_iter();
    items.map(|item| (item.generation, item.seq)).collect()
}

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let since = Instant::now();
    while !is_so() {
        assert!(since.elapsed() < MAX_WAIT, "waited in vain until {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_receiver_gets_all_from_the_message_that_it_asks_for_and_knows_the_end() {
    let address = endpoint();
    // The receiver is there first, and tries again until the sender is.
    let there = {
        let network = connecting(&address);
        thread::spawn(|| open(network))
    };
    let here = open(listening(&address));
    let there = there.join().unwrap();
    let fetcher = fetcher(&there, 3);
    let buffer = Arc::new(MemoryBuffer::of(100));
    (0..5).for_each(|seq| add(&buffer, seq));
    let mut server = Server::new(&here, "gyre/test", None);
    let offer = server.offer("topic", buffer.clone()).unwrap();
    assert_eq!(take(&fetcher, 2), [3, 4]);
    assert!(fetcher.is_connected() && offer.answered() == 3);
    add(&buffer, 5);
    assert_eq!(take(&fetcher, 1), [5]);
    fetcher.confirm(6);
    until("the sender knows that all have arrived", || {
        offer.answered() == 6
    });
    until("the receiver knows that the sender knows", || {
        fetcher.is_confirmed(6)
    });
    assert!(!offer.is_done());
    buffer.end().unwrap();
    until("the receiver knows the end", || fetcher.has_ended());
    assert!(offer.is_done(), "the receiver has said so before");
    assert_eq!(offer.sent().0, 3);
}

/// A sender of a topic, and a receiver that has its first message.
struct Ends {
    buffer: Arc<MemoryBuffer>,
    offer: Arc<Offer>,
    fetcher: Fetcher,
    there: Session,
    _server: Server,
    _here: Session,
}

impl Ends {
    fn new() -> Self {
        let address = endpoint();
        let here = open(listening(&address));
        let there = open(connecting(&address));
        let buffer = Arc::new(MemoryBuffer::of(100));
        add(&buffer, 0);
        let mut server = Server::new(&here, "gyre/test", None);
        let offer = server.offer("topic", buffer.clone()).unwrap();
        let fetcher = fetcher(&there, 0);
        assert_eq!(take(&fetcher, 1), [0]);
        assert!(!offer.is_done());
        Self {
            buffer,
            offer,
            fetcher,
            there,
            _server: server,
            _here: here,
        }
    }
}

#[test]
fn a_receiver_gets_what_takes_the_place_of_messages_that_have_become_void() {
    let ends = Ends::new();
    let add = |generation, numbered_from, seq, flags| {
        let item = Item {
            generation,
            numbered_from,
            flags,
            ..Item::numbered(seq)
        };
        add_item(&ends.buffer, &item);
    };
    for seq in 1..8 {
        add(1, 0, seq, 0);
    }
    add(1, 0, 8, flag::END);
    let received = take_of_generations(&ends.fetcher, 8);
    assert_eq!(received.last(), Some(&(1, 8)));
    // Masking was killed when item 3 was the newest with a pose, and again when 5 was.
    for (generation, first, last) in [(2, 4, 6), (3, 6, 9)] {
        (first..=last).for_each(|seq| add(generation, first, seq, 0));
        let expected: Vec<(u32, u64)> = (first..=last).map(|seq| (generation, seq)).collect();
        assert_eq!(take_of_generations(&ends.fetcher, expected.len()), expected);
    }
    add(3, 6, 10, flag::END);
    assert_eq!(take_of_generations(&ends.fetcher, 1), [(3, 10)]);
    // Another session of the same receiver continues after the messages that it has.
    let again = |from, generation| fetching(&ends.there, from, generation, "another".to_owned());
    let fetcher = again(8, 3);
    assert_eq!(take_of_generations(&fetcher, 3), [(3, 8), (3, 9), (3, 10)]);
    fetcher.leave();
    let fetcher = again(8, 2);
    let received = take_of_generations(&fetcher, 5);
    assert_eq!(received, [(3, 6), (3, 7), (3, 8), (3, 9), (3, 10)]);
}

#[test]
fn an_end_that_has_not_arrived_is_not_taken_for_known() {
    let ends = Ends::new();
    // The receiver dies: the end is sent to nobody.
    drop(ends.fetcher);
    ends.there.close().wait().unwrap();
    ends.buffer.end().unwrap();
    thread::sleep(Duration::from_secs(1));
    assert!(!ends.offer.is_done());
}

#[test]
fn a_receiver_that_leaves_is_not_waited_for() {
    let ends = Ends::new();
    ends.fetcher.leave();
    assert!(ends.offer.is_done());
}

#[test]
fn a_router_of_zenoh_may_be_between_the_ends() {
    let address = endpoint();
    let settings = format!(
        r#"{{ "mode": "router", "listen": {{ "endpoints": ["{address}"] }}, "scouting": {{ "multicast": {{ "enabled": false }} }} }}"#
    );
    let _router = zenoh::open(zenoh::Config::from_json5(&settings).unwrap())
        .wait()
        .unwrap();
    let [here, there] = [(); 2].map(|()| open(connecting(&address)));
    let buffer = Arc::new(MemoryBuffer::of(100));
    add(&buffer, 0);
    let mut server = Server::new(&here, "gyre/test", None);
    server.offer("topic", buffer).unwrap();
    let fetcher = fetcher(&there, 0);
    assert_eq!(take(&fetcher, 1), [0]);
}

/// Lets bytes pass in both directions, so many a second.
fn slow_network(to: String, bytes_per_s: usize) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp/{}", listener.local_addr().unwrap());
    let pass = move |mut from: TcpStream, mut to: TcpStream| {
        let mut piece = vec![0; bytes_per_s / 20];
        while let Ok(count @ 1..) = from.read(&mut piece) {
            thread::sleep(Duration::from_secs_f64(count as f64 / bytes_per_s as f64));
            if to.write_all(&piece[..count]).is_err() {
                return;
            }
        }
    };
    thread::spawn(move || {
        for here in listener.incoming().flatten() {
            let Ok(there) = TcpStream::connect(to.trim_start_matches("tcp/")) else {
                continue;
            };
            let back = (there.try_clone().unwrap(), here.try_clone().unwrap());
            thread::spawn(move || pass(here, there));
            thread::spawn(move || pass(back.0, back.1));
        }
    });
    address
}

#[test]
fn messages_that_take_longer_than_a_lost_request_arrive_each_once() {
    let address = endpoint();
    let here = open(listening(&address));
    let there = open(connecting(&slow_network(address, 400_000)));
    let buffer = Arc::new(MemoryBuffer::of(100));
    // Some 15 s each.
    for seq in 0..2 {
        buffer.add(&RecordedMessage {
            header: bytemuck::bytes_of(&Item::numbered(seq)).to_vec(),
            payload: vec![seq as u8; 6_000_000],
        });
    }
    let mut server = Server::new(&here, "gyre/test", None);
    let offer = server.offer("topic", buffer).unwrap();
    let fetcher = fetcher(&there, 0);
    assert_eq!(take(&fetcher, 2), [0, 1]);
    // The first one was sent twice, or three times on a machine that is busy.
    assert!((3..=6).contains(&offer.sent().0), "{:?}", offer.sent());
}
