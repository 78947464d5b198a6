//! temporary
use rc10_emu::Machine;
use rc10_sim::{Nanos, World};
fn main() {
    let mut args = std::env::args().skip(1);
    let file = std::fs::read(args.next().unwrap()).unwrap();
    let ms: u64 = args.next().unwrap().parse().unwrap();
    let mut machine = Machine::new(&file).unwrap();
    let mut world = World::new(1);
    let start = std::time::Instant::now();
    machine.run(&mut world, Nanos::new(ms * 1_000_000)).unwrap();
    let t = start.elapsed().as_secs_f64();
    let n = machine.profile().total();
    println!("{n} instructions, {t:.3} s, {:.2} M/s", n as f64 / t / 1e6);
    let mut h: u64 = 0;
    for c in machine.profile().by_exception() {
        h = h.wrapping_mul(31).wrapping_add(c.entries * 7 + c.instructions * 3 + c.clocks);
        println!("{c:?}");
    }
    for l in machine.take_log().iter().take(200) {
        println!("{:?}", l);
    }
    println!("{:?} {:x} {:?}", machine.reports(), h, machine.profile().lowest_stack());
}
