// Runs an FMU for co-simulation with FMI4j: Simulate FMU STEPS STEP EVERY CSV VARIABLE...
// Sets tolerance_relative to 1e-8 and writes the variables at the start and after every EVERY steps.

import java.io.File;
import java.io.PrintWriter;
import java.util.Arrays;
import java.util.List;
import no.ntnu.ihb.fmi4j.Fmi4jVariableUtils;
import no.ntnu.ihb.fmi4j.importer.fmi2.CoSimulationSlave;
import no.ntnu.ihb.fmi4j.importer.fmi2.Fmu;

public class Simulate {
  public static void main(String[] arguments) throws Exception {
    int steps = Integer.parseInt(arguments[1]);
    double step = Double.parseDouble(arguments[2]);
    int every = Integer.parseInt(arguments[3]);
    List<String> names = Arrays.asList(arguments).subList(5, arguments.length);
    try (Fmu fmu = Fmu.from(new File(arguments[0]));
        PrintWriter csv = new PrintWriter(arguments[4])) {
      CoSimulationSlave slave = fmu.asCoSimulationFmu().newInstance("game");
      Fmi4jVariableUtils.writeReal(slave, "tolerance_relative", 1e-8);
      require(slave.setupExperiment(0.0, steps * step, 0.0), "fmi2SetupExperiment");
      require(slave.enterInitializationMode(), "fmi2EnterInitializationMode");
      require(slave.exitInitializationMode(), "fmi2ExitInitializationMode");
      csv.println("time;" + String.join(";", names));
      for (int k = 0; k <= steps; ++k) {
        if (k % every == 0) {
          csv.print(k * step);
          for (String name : names) csv.print(";" + Fmi4jVariableUtils.readReal(slave, name).getValue());
          csv.println();
        }
        if (k < steps) require(slave.doStep(k * step, step), "fmi2DoStep");
      }
      require(slave.terminate(), "fmi2Terminate");
    }
  }

  private static void require(boolean fine, String call) {
    if (!fine) throw new IllegalStateException(call + " failed");
  }
}
