package cnctwin;

import java.io.IOException;
import java.util.Arrays;

/**
 * Kafka in this process, until the standard input ends: whoever started it cannot leave it behind, however he ends. Arguments: the
 * file of properties, then those of "kafka-storage format", which leaves alone what is formatted already.
 */
public final class Server {

    private Server() {}

    public static void main(final String[] arguments) {
        final Thread watch = new Thread(Server::endWithTheInput, "standard input");
        watch.setDaemon(true);
        watch.start();
        final String[] format = Arrays.copyOf(arguments, arguments.length);
        format[0] = "format";
        final int failed = kafka.tools.StorageTool.execute(format, System.out);
        if (failed != 0) {
            System.exit(failed);
        }
        kafka.Kafka.main(new String[] {arguments[0]});
    }

    private static void endWithTheInput() {
        try {
            while (System.in.read() >= 0) {
                // The one who started this process lives.
            }
        } catch (final IOException unreadable) {
            // As good as ended.
        }
        Runtime.getRuntime().halt(0);
    }
}
