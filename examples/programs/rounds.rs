// A behavior in a process of its own, in Rust without any library: from room to room, ten minutes in each.
//
// rustc -O rounds.rs
// robots: {astro: {behaviors: [{type: process, command: rounds}]}}
use std::io::{self, BufRead, Write};

fn main() {
    let mut rooms: Vec<String> = Vec::new();
    let mut visits = 0;
    for line in io::stdin().lock().lines().map_while(Result::ok) {
        let mut answer = String::from(r#"{"type": "ready"}"#);
        if line.contains(r#""type": "start""#) {
            let list = line.split(r#""rooms": ["#).nth(1).unwrap_or("").split(']').next().unwrap_or("");
            rooms = list.split(r#""name": ""#).skip(1).map(|part| part.split('"').next().unwrap_or("").to_string()).collect();
        } else if line.contains(r#""type": "decide""#) {
            let room = &rooms[visits % rooms.len()];
            visits += 1;
            answer = format!(r#"{{"type": "plan", "plan": [{{"go_to": ["{room}", "any"]}}, {{"turn_deg": 360}}, {{"stay_s": 600}}]}}"#);
        }
        println!("{answer}");
        io::stdout().flush().unwrap_or(());
    }
}
