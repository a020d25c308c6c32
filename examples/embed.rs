//! A filter inside a program: load a design, feed it by stream and time, listen to it, read it.
#![expect(clippy::print_stdout, reason = "an example prints")]

use fusion::core::{Time, filter::Verdict, runner::Event};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut nav = fusion::Navigator::from_toml(include_str!("embed.toml"))?;
    let (imu, gnss) = (nav.stream("imu")?, nav.stream("gnss")?);
    let mut listen = |event: &Event<'_>| match event {
        Event::Started { belief, .. } => println!("started at {}", belief.time),
        Event::Updated { update, time, .. } if update.verdict == Verdict::Rejected => println!("rejected at {time}: NIS {:.0}", update.nis),
        _ => {}
    };
    for k in 0..=6000 {
        let time = Time::from_nanos(k * 10_000_000);
        nav.feed_stream(imu, time, &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8], &mut listen)?;
        if k % 100 == 0 {
            let height = if k == 4500 { 80.0 } else { 50.0 };
            nav.feed_stream(gnss, time, &[0.63, 2.26, height], &mut listen)?;
        }
    }
    nav.finish(&mut listen)?;
    let belief = nav.belief().ok_or("it never started")?;
    for block in nav.layout().blocks() {
        let value = &belief.x[block.storage_range()];
        let sigma: Vec<f64> = belief.covariance.sigmas(block).collect();
        println!("{:12} {value:9.6?}, 1σ {sigma:.6?} {}", block.name, block.unit);
    }
    let (rpy, sigma) = nav.solution().and_then(|s| s.rpy()).ok_or("it has no attitude")?;
    println!("heading {:.2} deg, 1σ {:.2} deg", rpy.z.to_degrees(), sigma.z.to_degrees());
    Ok(())
}
