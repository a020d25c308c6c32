# Writes the log of a car that drives round two blocks: imu.csv, gnss.csv and truth.csv in a folder.
#
#   awk -v folder=drive -f book/src/drive.awk
#
# The IMU is a low-cost MEMS unit at 100 Hz. It is mounted x forward, y left, z up, and logs g and
# deg/s: columns as many units log them. The antenna is 0.4 m ahead of it and 1.5 m above. The
# receiver gives position and velocity at 1 Hz. Its position has a slow error beside the white one, as
# single-point GNSS has. Any awk writes the same numbers: the random generator is part of this file.

function random() { seed = (16807 * seed) % 2147483647; return seed / 2147483647 }
function normal(    size) { size = sqrt(-2 * log(random())); return size * cos(2 * pi * random()) }
function limit(x, most) { return x > most ? most : x < -most ? -most : x }

# Speed wanted [m/s] and rate of turn wanted [rad/s] at time t: stand, drive, turn eight times, stand.
function wanted(t,    leg) {
    speed = t < 30 ? 0 : t < 270 ? 10 : 0
    leg = (t - 45) % 25
    turn = t < 45 || t > 245 || leg > 8 ? 0 : pi / 16 * (t < 145 ? 1 : -1)
}

BEGIN {
    imu = folder "/imu.csv"; gnss = folder "/gnss.csv"; truth = folder "/truth.csv"
    pi = atan2(0, -1); deg = pi / 180; g = 9.80668; seed = 42
    lat = 47 * deg; lon = 8.5 * deg; height = 430
    meridian = 6370050; normal_radius = 6390017; earth = 7.292115e-5
    bias_x = 0.03; bias_y = -0.02; bias_z = 0.05                    # accelerometers [m/s^2]
    drift_x = 0.2 * deg; drift_y = -0.1 * deg; drift_z = 0.15 * deg # gyros [rad/s]
    heading = 30 * deg; dt = 0.001
    print "t_s,ax_g,ay_g,az_g,gx_dps,gy_dps,gz_dps" > imu
    print "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps" > gnss
    print "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps,heading_deg" > truth
    for (k = 1; k <= 300000; k++) {
        t = k * dt
        wanted(t)
        acceleration = limit((speed - v) / 0.3, 1.5)
        rate += limit((turn - rate) / 0.2, 0.5) * dt                # the steering wheel takes time
        used = v > 0.5 ? rate : 0
        heading += used * dt
        v += acceleration * dt
        north += v * cos(heading) * dt
        east += v * sin(heading) * dt
        # Sums over one sample of the IMU, in axes forward, right, down.
        fx += acceleration / 10; fy += v * used / 10
        wx += earth * cos(lat) * cos(heading) / 10
        wy -= earth * cos(lat) * sin(heading) / 10
        wz += (used - earth * sin(lat)) / 10
        if (k % 10 == 0) {
            shake = v > 0.1 ? 0.06 : 0.02                           # the road [m/s^2]
            printf "%.2f,%.6f,%.6f,%.6f,%.5f,%.5f,%.5f\n", t, \
                (fx + bias_x + shake * normal()) / 9.80665, \
                -(fy + bias_y + shake * normal()) / 9.80665, \
                (g - bias_z + shake * normal()) / 9.80665, \
                (wx + drift_x) / deg + 0.05 * normal(), \
                -(wy + drift_y) / deg + 0.05 * normal(), \
                -(wz + drift_z) / deg + 0.05 * normal() > imu
            fx = fy = wx = wy = wz = 0
        }
        if (k % 100 == 0)
            printf "%.1f,%.9f,%.9f,%.3f,%.4f,%.4f,0,%.4f\n", t, (lat + north / meridian) / deg, \
                (lon + east / normal_radius / cos(lat)) / deg, height, v * cos(heading), \
                v * sin(heading), heading / deg > truth
        if (k % 1000 == 0) {
            fade = exp(-1 / 60); grow = sqrt(1 - fade * fade)
            slow_n = fade * slow_n + grow * normal()
            slow_e = fade * slow_e + grow * normal()
            slow_h = fade * slow_h + grow * 1.5 * normal()
            n = north + 0.4 * cos(heading) + slow_n + 0.7 * normal()
            e = east + 0.4 * sin(heading) + slow_e + 0.7 * normal()
            printf "%.1f,%.9f,%.9f,%.3f,%.3f,%.3f,%.3f\n", t, (lat + n / meridian) / deg, \
                (lon + e / normal_radius / cos(lat)) / deg, height + 1.5 + slow_h + 1.2 * normal(), \
                v * cos(heading) - 0.4 * used * sin(heading) + 0.05 * normal(), \
                v * sin(heading) + 0.4 * used * cos(heading) + 0.05 * normal(), \
                0.08 * normal() > gnss
        }
    }
}
