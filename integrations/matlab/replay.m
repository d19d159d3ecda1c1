function replay(controller)
    % replay(Fracgyro())  Compare bits: answers the file "motion" in the file "answer".
    %
    % A motion is x, y and their rates; an answer the number of the status, the force x, y, and what the controller
    % reported before it. All are numbers of the controller's type.
    in = fopen('motion', 'r', 'ieee-le');
    motion = fread(in, [4 Inf], ['*' controller.number]);
    fclose(in);
    answer = [];
    for k = 1:size(motion, 2)
        report = struct2cell(controller.estimates());
        [force, status] = controller.step(motion(1:2, k), motion(3:4, k));
        row = vertcat(find(strcmp(status, controller.statuses)) - 1, force, report{:});
        if k == 1
            answer = zeros(length(row), size(motion, 2));
        end
        answer(:, k) = row;
    end
    out = fopen('answer', 'w', 'ieee-le');
    fwrite(out, answer, controller.number);
    fclose(out);
end
